# Makes the comments of dcd.h and dcd.hpp Doxygen's: perl -0777 -p dcd-ffi/doxygen.pl include/dcd.h
s{^/\* }{/** \\file\n * };
# One that stands alone is the heading of a part, not of what follows it.
s{^( *)/\* (?!.*\*/\n\n)}{$1/** }gm;
s{^( *)//( |$)}{$1///$2}gm;
# The names of its inline namespaces are the linker's business.
s{^(inline namespace .*\{|\} // inline namespace)\n}{\n}gm;
# Functions and constants that comments name become links, so that a name that is none fails; code stays as it is.
s{^(?: *///| *\/\*\*| \*(?!     )).*}{
    my $line = $&;
    $line =~ s/\b(dcd_[a-z_]+)\b(?:\(\)|(?!\())/#$1()/g;
    $line =~ s/\bDCD_[A-Z0-9_]*[A-Z0-9]\b/#$&/g;
    # Macros that a program may define are none of the headers.
    $line =~ s/#(DCD_SHARED|DCD_EXCEPTIONS)\b/`$1`/g;
    $line
}gme;
