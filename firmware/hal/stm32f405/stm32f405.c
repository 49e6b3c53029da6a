/* STM32F405: Cortex-M4F at 168 MHz from a crystal, USART1 at 115200 8N1 on PA9 (out) and PA10 (in), independent watchdog.
 *
 * The crystal is HSE_MHZ (8 unless the build says otherwise). Where it or the clock controller does not answer, the chip stays
 * on its 16 MHz RC oscillator, and the baud rate is computed for that; its 1 % is within what a UART forgives. A crystal
 * that dies later resets the chip, which then starts without it.
 *
 * Registers: ST RM0090, chapters RCC, FLASH, GPIO, USART, IWDG, DBG.
 */
#include "../cortex-m/registers.h"
#include "../cortex-m/ring.h"
#include "../cortex-m/start.h"

#ifndef HSE_MHZ
#define HSE_MHZ 8u
#endif
_Static_assert(HSE_MHZ >= 4u && HSE_MHZ <= 26u, "the crystal of an STM32F405 has 4 to 26 MHz");

#define HSI_HZ 16000000u
#define PLL_HZ 168000000u
#define BAUD 115200u
#define SPINS 200000u /* some 160 ms at 16 MHz; a crystal takes a few, and the watchdog bites after 0.68 s */

#define RCC_CR REGISTER(0x40023800u)
#define CR_HSE_ON (1u << 16)
#define CR_HSE_READY (1u << 17)
#define CR_CSS_ON (1u << 19) /* crystal lost: NMI, and back to HSI */
#define CR_PLL_ON (1u << 24)
#define CR_PLL_READY (1u << 25)
#define RCC_PLL REGISTER(0x40023804u)
#define PLL_SETTING (HSE_MHZ | 336u << 6 | 0u << 16 | 1u << 22 | 7u << 24) /* /M to 1 MHz, x336, /2 (code 0), from HSE, /7 */
#define RCC_CFGR REGISTER(0x40023808u)
#define CFGR_PRESCALERS (5u << 10 | 4u << 13) /* APB1 /4: 42 MHz, APB2 /2: 84 MHz */
#define CFGR_SWITCH 3u
#define CFGR_TO_PLL 2u
#define CFGR_ON_PLL (2u << 2)
#define RCC_AHB1_ENABLE REGISTER(0x40023830u)
#define AHB1_GPIOA 1u
#define RCC_APB1_ENABLE REGISTER(0x40023840u)
#define APB1_PWR (1u << 28)
#define RCC_APB2_ENABLE REGISTER(0x40023844u)
#define APB2_USART1 (1u << 4)
#define RCC_RESETS REGISTER(0x40023874u) /* why there were resets, until that is forgotten */
#define RESETS_BY_IWDG (1u << 29)
#define RESETS_FORGET (1u << 24)

#define PWR_CR REGISTER(0x40007000u)
#define PWR_SCALE_1 (1u << 14) /* what 168 MHz needs */
#define FLASH_ACR REGISTER(0x40023C00u)
#define FLASH_WAITS 7u
#define FLASH_FIVE_WAITS (5u | 1u << 8 | 1u << 9 | 1u << 10) /* with prefetch and both caches */

#define GPIOA_MODE REGISTER(0x40020000u)
#define GPIOA_PULL REGISTER(0x4002000Cu)
#define GPIOA_FUNCTION_HIGH REGISTER(0x40020024u)

#define USART_STATUS REGISTER(0x40011000u)
#define USART_DATA REGISTER(0x40011004u)
#define USART_DIVIDER REGISTER(0x40011008u)
#define USART_CONTROL REGISTER(0x4001100Cu)
#define STATUS_ERRORS 0xFu /* parity, framing, noise, overrun; a read of STATUS, then of DATA clears them */
#define STATUS_RX_FULL (1u << 5)
#define STATUS_TX_EMPTY (1u << 7)
#define CONTROL_ON (1u << 13 | 1u << 5 | 1u << 3 | 1u << 2) /* USART, receive interrupt (also by overrun), both ways */
#define USART1_IRQ 37u

#define IWDG_KEY REGISTER(0x40003000u)
#define IWDG_PRESCALER REGISTER(0x40003004u)
#define IWDG_RELOAD REGISTER(0x40003008u)
#define IWDG_STATUS REGISTER(0x4000300Cu)
#define KEY_START 0xCCCCu
#define KEY_UNLOCK 0x5555u
#define KEY_KICK 0xAAAAu
#define IWDG_BY_32 3u
#define IWDG_COUNTS 1000u /* 1 ms each at 32 kHz: 1 s, and 0.68 to 1.9 s over the oscillator's 17 to 47 kHz */
#define DEBUG_APB1_FREEZE REGISTER(0xE0042008u)
#define FREEZE_IWDG (1u << 12) /* a halt in the debugger is no hang */

#define LOOK_EVERY 16u /* writes, at the stack: it takes some thousand cycles */

const hal *hal_start(void);
void on_usart(void);

static ring received;
static struct hal_health health;
static uint32_t writes;

/* A byte with a framing or noise error is handed on all the same: the CRC decides. */
void on_usart(void) {
    uint32_t status = USART_STATUS;
    if ((status & (STATUS_RX_FULL | STATUS_ERRORS)) == 0u) return;
    uint8_t byte = (uint8_t)USART_DATA;
    bool lost = (status & STATUS_RX_FULL) != 0u && ring_full(&received);
    if ((status & STATUS_ERRORS) != 0u || lost) health.rx_errors += 1u;
    if ((status & STATUS_RX_FULL) != 0u && !lost) ring_put(&received, byte);
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
    return ring_take(&received, into, size);
}

static void hal_write(void *self, const uint8_t *bytes, size_t size) {
    (void)self;
    for (; size--; bytes++) {
        while ((USART_STATUS & STATUS_TX_EMPTY) == 0u) {}
        USART_DATA = *bytes;
    }
    if (++writes % LOOK_EVERY == 0u) health.stack_bytes = stack_high_water();
}

static void hal_kick(void *self) {
    (void)self;
    IWDG_KEY = KEY_KICK;
}

static bool comes(volatile uint32_t *where, uint32_t mask, uint32_t value) {
    for (uint32_t spin = 0; spin < SPINS; spin++) {
        if ((*where & mask) == value) return true;
    }
    return false;
}

/* Returns the core's clock: PLL_HZ, or HSI_HZ, the state after reset, where an oscillator does not come. */
static uint32_t core_start(void) {
    RCC_CR |= CR_HSE_ON;
    if (!comes(&RCC_CR, CR_HSE_READY, CR_HSE_READY)) {
        RCC_CR &= ~CR_HSE_ON;
        return HSI_HZ;
    }
    RCC_APB1_ENABLE |= APB1_PWR;
    PWR_CR |= PWR_SCALE_1;
    RCC_PLL = PLL_SETTING;
    RCC_CR |= CR_PLL_ON | CR_CSS_ON;
    if (!comes(&RCC_CR, CR_PLL_READY, CR_PLL_READY)) return HSI_HZ;
    FLASH_ACR = FLASH_FIVE_WAITS;
    if (!comes(&FLASH_ACR, FLASH_WAITS, FLASH_FIVE_WAITS & FLASH_WAITS)) return HSI_HZ;
    RCC_CFGR = CFGR_PRESCALERS;
    RCC_CFGR = CFGR_PRESCALERS | CFGR_TO_PLL;
    if (comes(&RCC_CFGR, CFGR_SWITCH << 2, CFGR_ON_PLL)) return PLL_HZ;
    RCC_CFGR = 0u;
    return HSI_HZ;
}

static void usart_start(uint32_t bus_hz) {
    RCC_AHB1_ENABLE |= AHB1_GPIOA;
    RCC_APB2_ENABLE |= APB2_USART1;
    (void)RCC_APB2_ENABLE; /* a peripheral answers two cycles after its clock is on */
    GPIOA_FUNCTION_HIGH = (GPIOA_FUNCTION_HIGH & ~(0xFFu << 4)) | 0x77u << 4;
    GPIOA_PULL = (GPIOA_PULL & ~(0xFu << 18)) | 0x5u << 18; /* up: an open line is idle */
    GPIOA_MODE = (GPIOA_MODE & ~(0xFu << 18)) | 0xAu << 18;
    USART_DIVIDER = (bus_hz + BAUD / 2u) / BAUD;
    USART_CONTROL = CONTROL_ON;
    irq_enable(USART1_IRQ);
}

static void watchdog_start(void) {
    DEBUG_APB1_FREEZE |= FREEZE_IWDG;
    IWDG_KEY = KEY_START;
    IWDG_KEY = KEY_UNLOCK;
    IWDG_PRESCALER = IWDG_BY_32;
    IWDG_RELOAD = IWDG_COUNTS;
    (void)comes(&IWDG_STATUS, 3u, 0u);
    IWDG_KEY = KEY_KICK;
}

/* This watchdog bites without a warning: that it did is seen afterwards only, and where the firmware hung nobody can tell. */
static void watchdog_note(void) {
    if ((RCC_RESETS & RESETS_BY_IWDG) != 0u) boot_note(BOOT_WATCHDOG, 0u, 0u);
    RCC_RESETS |= RESETS_FORGET;
}

const hal *hal_start(void) {
    static const hal this_chip = {
        .now = clock_now,
        .wait = hal_wait,
        .read = hal_read,
        .write = hal_write,
        .kick = hal_kick,
        .own_timer = true,
        .build = BUILD,
        .health = &health,
    };
    watchdog_start();
    watchdog_note();
    uint32_t core_hz = core_start();
    clock_start(core_hz);
    usart_start(core_hz == PLL_HZ ? PLL_HZ / 2u : core_hz);
    return &this_chip;
}

__attribute__((section(".vectors"), used)) const vector vectors[16 + 82] = {
    [0] = (vector)(void *)stack_top,
    [1] = (vector)on_reset,
    [2 ... 14] = on_fault,
    [15] = on_systick,
    [16 ... 16 + USART1_IRQ - 1] = on_fault,
    [16 + USART1_IRQ] = on_usart,
    [16 + USART1_IRQ + 1 ... 16 + 81] = on_fault,
};
