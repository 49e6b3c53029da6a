/* What every Cortex-M4 has: system control block, SysTick, interrupt controller, and the few instructions C has no word for.
 * Addresses and bits: ARMv7-M Architecture Reference Manual, section B3.
 */
#ifndef CORTEX_M_REGISTERS_H
#define CORTEX_M_REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#define SYSTICK_CONTROL REGISTER(0xE000E010u)
#define SYSTICK_RELOAD REGISTER(0xE000E014u)
#define SYSTICK_VALUE REGISTER(0xE000E018u)
#define SYSTICK_ENABLE 1u
#define SYSTICK_INTERRUPT 2u
#define SYSTICK_CORE_CLOCK 4u

#define NVIC_ENABLE(irq) REGISTER(0xE000E100u + 4u * ((irq) / 32u)) /* write 1u << irq % 32 */

#define SCB_ICSR REGISTER(0xE000ED04u)
#define SCB_VTOR REGISTER(0xE000ED08u)
#define SCB_AIRCR REGISTER(0xE000ED0Cu)
#define SCB_CFSR REGISTER(0xE000ED28u)
#define SCB_CPACR REGISTER(0xE000ED88u)
#define ICSR_SYSTICK_PENDING (1u << 26)
#define AIRCR_KEY 0x05FA0000u
#define AIRCR_SYSTEM_RESET (1u << 2)
#define CPACR_FPU_FULL (0xFu << 20) /* coprocessors 10 and 11, privileged and not */

static inline void irq_enable(uint32_t irq) { NVIC_ENABLE(irq) = 1u << (irq % 32u); }

static inline void interrupts_off(void) { __asm volatile("cpsid i" ::: "memory"); }
static inline void interrupts_on(void) { __asm volatile("cpsie i" ::: "memory"); }

/* Also returns at once when an interrupt is pending that interrupts_off() holds back: so a check before it cannot be late. */
static inline void wait_for_interrupt(void) { __asm volatile("wfi" ::: "memory"); }

/* Everything written before is seen, and every instruction after is fetched anew. */
static inline void barrier(void) { __asm volatile("dsb\n\tisb" ::: "memory"); }

#endif
