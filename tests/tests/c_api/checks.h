/* How the C programs of these tests check, and count failures. */
#ifndef CHECKS_H
#define CHECKS_H

#include "dcd.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int checks, failures;

#define HOLDS(what) holds((what), #what, __LINE__)
#define OK(call) expect((call), DCD_OK, "", #call, __LINE__)
#define EXPECT(call, code) expect((call), (code), "", #call, __LINE__)
#define FAILS(call, code, word) expect((call), (code), (word), #call, __LINE__)

static inline void holds(bool what, const char *text, int line)
{
    checks++;
    if (!what) {
        printf("line %d: not so: %s\n", line, text);
        failures++;
    }
}

/* Checks the status of a call. A failed call must leave a message of at least 20 characters that contains
 * `word`. */
static inline void expect(DcdStatus got, DcdStatus code, const char *word, const char *text, int line)
{
    char message[1024] = "";
    checks++;
    const size_t length = dcd_last_error(message, sizeof message);
    if (got != code || (code != DCD_OK && (length < 20 || strstr(message, word) == NULL))) {
        printf("line %d: %s is %s, not %s with \"%s\": %s\n", line, text, dcd_status_string(got), dcd_status_string(code),
               word, message);
        failures++;
    }
}

/* Prints what each program prints last, and returns its exit status. */
static inline int checked(void)
{
    printf("%d checks, %d failures\n", checks, failures);
    return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

#endif /* CHECKS_H */
