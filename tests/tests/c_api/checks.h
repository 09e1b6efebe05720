/* How the C programs of these tests check, and count what fails. */
#ifndef CHECKS_H
#define CHECKS_H

#include "dcd.h"

#include <stdio.h>
#include <string.h>

static int checks, failures;

#define HOLDS(what) holds((what), #what, __LINE__)
#define OK(call) expect((call), DCD_OK, "", #call, __LINE__)
#define FAILS(call, code, word) expect((call), (code), (word), #call, __LINE__)

static inline void holds(bool what, const char *text, int line)
{
    checks++;
    if (!what) {
        printf("line %d: not so: %s\n", line, text);
        failures++;
    }
}

/* The status must be this, and the message of a failure must have the word. */
static inline void expect(DcdStatus got, DcdStatus code, const char *word, const char *text, int line)
{
    char message[1024] = "";
    checks++;
    dcd_last_error(message, sizeof message);
    if (got != code || (code != DCD_OK && strstr(message, word) == NULL)) {
        printf("line %d: %s is %s, not %s with \"%s\": %s\n", line, text, dcd_status_string(got), dcd_status_string(code),
               word, message);
        failures++;
    }
}

/* The last line of every such program; what it returns. */
static inline int checked(void)
{
    printf("%d checks, %d failures\n", checks, failures);
    return failures > 0;
}

#endif /* CHECKS_H */
