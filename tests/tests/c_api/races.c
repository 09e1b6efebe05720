/* Functions of LLVM's ThreadSanitizer that Rust's code calls and GCC's lacks. The C library's own functions
 * are intercepted, and so also checked for races. */
#include <string.h>

void *__tsan_memcpy(void *to, const void *from, size_t size)
{
    return memcpy(to, from, size);
}

void *__tsan_memmove(void *to, const void *from, size_t size)
{
    return memmove(to, from, size);
}

void *__tsan_memset(void *to, int value, size_t size)
{
    return memset(to, value, size);
}
