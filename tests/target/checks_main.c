/* SPDX-License-Identifier: Apache-2.0 */
/* The unit checks on the processor, RUN_METHOD in RUN_TYPE: a slice that fits a small memory. No stdio: it would take memory from a heap. */
#include <stdint.h>

#include "checks.h"

static int semihosting(int operation, const void *argument) {
    register int r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void say(const char *text) { semihosting(4, text); }

static void say_number(int value) {
    char digits[12], *at = digits + sizeof digits - 1;
    *at = 0;
    do *--at = (char)('0' + value % 10);
    while (value /= 10);
    say(at);
}

/* In place of the C library's start: memory is as the loader left it, nothing is to be initialised. */
void _start(void);
void _start(void) {
    int failed = 0, run = 0;
    for (const char *name; (name = checks_name((unsigned)run)); run++) {
        const int line = checks_run((unsigned)run, RUN_METHOD, RUN_TYPE);
        if (line) say(name), say(" fails at checks.c:"), say_number(line), say("\n");
        failed += line != 0;
    }
    say_number(run), say(" checks, "), say_number(failed), say(" failed\n");
    const uint32_t leave[2] = {0x20026, failed != 0};
    semihosting(0x20, leave);
    for (;;) {}
}
