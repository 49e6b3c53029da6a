/* Arm MPS2 with the AN386 image: Cortex-M4F at 25 MHz, UART0 at 115200 8N1, watchdog. What QEMU and the emulator run, too.
 *
 * What an emulator of this image has to have: the two memories of the linker script; UART0 with its receive interrupt 0;
 * the watchdog's five registers and the private bus from 0xE000E000, which may be plain memory; WFI. The image waits with
 * interrupts off (WFI, then CPSIE I, one after the other): WFI must return when an interrupt is pending that is held back.
 * A SysTick that does not tick stops clock_now() and nothing else, for this board has no timer of its own: own_timer is
 * false, because the time of an emulated chip is not the laboratory's.
 *
 * The UART has no FIFO: one byte in, one byte out, two accesses each (state, then data). The interrupt takes all that is
 * there in one go. When the ring is full it leaves the byte where it is, so that a sender that can be held up (QEMU, the
 * emulator) is, and a real line overruns in the UART, which counts it; hal_read() fetches the rest.
 *
 * Registers: Arm Cortex-M System Design Kit, APB UART and APB watchdog; interrupt numbers: Application Note AN386.
 */
#include "../cortex-m/registers.h"
#include "../cortex-m/ring.h"
#include "../cortex-m/start.h"

#define CORE_HZ 25000000u
#define BAUD 115200u

#define UART_DATA REGISTER(0x40004000u)
#define UART_STATE REGISTER(0x40004004u)
#define UART_CONTROL REGISTER(0x40004008u)
#define UART_INTERRUPT_CLEAR REGISTER(0x4000400Cu)
#define UART_DIVIDER REGISTER(0x40004010u)
#define STATE_TX_FULL 1u
#define STATE_RX_FULL 2u
#define STATE_RX_OVERRUN 8u /* write 1 to clear */
#define CONTROL_TX 1u
#define CONTROL_RX 2u
#define CONTROL_RX_INTERRUPT 8u
#define INTERRUPT_RX 2u
#define UART_RX_IRQ 0u

#define WATCHDOG_LOAD REGISTER(0x40008000u)
#define WATCHDOG_CONTROL REGISTER(0x40008008u)
#define WATCHDOG_CLEAR REGISTER(0x4000800Cu) /* any write reloads */
#define WATCHDOG_LOCK REGISTER(0x40008C00u)
#define WATCHDOG_NMI_AND_RESET 3u
#define WATCHDOG_UNLOCKED 0x1ACCE551u
#define WATCHDOG_S 1u /* NMI after one, reset after two */

#define LOOK_EVERY 16u /* writes, at the stack: it takes some thousand cycles */

const hal *hal_start(void);
void on_uart_rx(void);

static ring received;
static volatile bool bytes_left_in_uart; /* the ring was full */
static struct hal_health health;
static uint32_t writes;

static void fill_ring(void) {
    uint32_t state;
    while ((state = UART_STATE) & STATE_RX_FULL) {
        if (state & STATE_RX_OVERRUN) {
            UART_STATE = STATE_RX_OVERRUN;
            health.rx_errors += 1u;
        }
        bytes_left_in_uart = ring_full(&received);
        if (bytes_left_in_uart) return;
        ring_put(&received, (uint8_t)UART_DATA);
    }
}

/* Cleared first: a byte that comes while the ring is filled asks again, at worst for nothing. */
void on_uart_rx(void) {
    UART_INTERRUPT_CLEAR = INTERRUPT_RX;
    fill_ring();
}

/* Time is looked at before interrupts are off: the clock needs them, and SysTick ends the WFI within a millisecond. */
static bool hal_wait(void *self, int64_t until_ns) {
    bool due = until_ns != HAL_FOREVER && clock_now(self) >= until_ns;
    interrupts_off();
    if (ring_empty(&received) && !due) wait_for_interrupt();
    interrupts_on();
    return true;
}

static size_t hal_read(void *self, uint8_t *into, size_t size) {
    (void)self;
    size_t count = ring_take(&received, into, size);
    if (bytes_left_in_uart) {
        interrupts_off();
        bytes_left_in_uart = false;
        fill_ring();
        interrupts_on();
    }
    return count;
}

static void hal_write(void *self, const uint8_t *bytes, size_t size) {
    (void)self;
    for (; size--; bytes++) {
        while (UART_STATE & STATE_TX_FULL) {}
        UART_DATA = *bytes;
    }
    if (++writes % LOOK_EVERY == 0u) health.stack_bytes = stack_high_water();
}

static void hal_kick(void *self) {
    (void)self;
    WATCHDOG_CLEAR = 1u;
}

static void watchdog_start(void) {
    WATCHDOG_LOCK = WATCHDOG_UNLOCKED;
    WATCHDOG_LOAD = WATCHDOG_S * CORE_HZ;
    WATCHDOG_CONTROL = WATCHDOG_NMI_AND_RESET;
}

static void uart_start(void) {
    UART_DIVIDER = (CORE_HZ + BAUD / 2u) / BAUD;
    UART_CONTROL = CONTROL_TX | CONTROL_RX | CONTROL_RX_INTERRUPT;
    irq_enable(UART_RX_IRQ);
}

const hal *hal_start(void) {
    static const hal this_chip = {
        .now = clock_now,
        .wait = hal_wait,
        .read = hal_read,
        .write = hal_write,
        .kick = hal_kick,
        .own_timer = false,
        .build = BUILD,
        .health = &health,
    };
    watchdog_start();
    clock_start(CORE_HZ);
    uart_start();
    return &this_chip;
}

/* The NMI is the watchdog's warning, half-way to its reset: a board that only stood still (QEMU was stopped) goes on. */
__attribute__((section(".vectors"), used)) const vector vectors[16 + 32] = {
    [0] = (vector)(void *)stack_top,
    [1] = (vector)on_reset,
    [2] = on_nmi_note,
    [3] = on_fault,
    [4] = on_fault,
    [5] = on_fault,
    [6] = on_fault,
    [7 ... 14] = on_fault,
    [15] = on_systick,
    [16 + UART_RX_IRQ] = on_uart_rx,
    [17 ... 16 + 31] = on_fault,
};
