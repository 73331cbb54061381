/* SPDX-License-Identifier: Apache-2.0 */
/* Reset of a bare Cortex-M under qemu: enable the floating-point unit where there is one, then the C library's start. */
#include <stdint.h>

extern uint32_t __stack;
extern void _start(void);

static void hang(void) {
    for (;;) {}
}

void Reset_Handler(void);
void Reset_Handler(void) {
#if defined(__ARM_FP)
    *(volatile uint32_t *)0xE000ED88 |= UINT32_C(0xF) << 20;
    __asm volatile("dsb\n isb");
#endif
    _start();
}

__attribute__((section(".isr_vector"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))(uintptr_t)&__stack, Reset_Handler, hang, hang, hang, hang, hang, 0, 0, 0, 0, hang, hang, 0, hang, hang};
