/* reset.c: see reset.h. */
#include "reset.h"

#include "registers.h"

/* A reset sets more flags than its own: every one inside the chip pulls NRST, hence PINRSTF, and a
 * power-on sets BORRSTF as well. The most specific comes first. */
static reset_cause_t cause_of(uint32_t flags) {
    if ((flags & RCC_CSR_PORRSTF) != 0) {
        return RESET_CAUSE_POWER_ON;
    }
    if ((flags & RCC_CSR_BORRSTF) != 0) {
        return RESET_CAUSE_BROWN_OUT;
    }
    if ((flags & RCC_CSR_IWDGRSTF) != 0) {
        return RESET_CAUSE_WATCHDOG;
    }
    if ((flags & RCC_CSR_WWDGRSTF) != 0) {
        return RESET_CAUSE_WINDOW_WATCHDOG;
    }
    if ((flags & RCC_CSR_LPWRRSTF) != 0) {
        return RESET_CAUSE_LOW_POWER;
    }
    if ((flags & RCC_CSR_SFTRSTF) != 0) {
        return RESET_CAUSE_SOFTWARE;
    }
    return (flags & RCC_CSR_PINRSTF) != 0 ? RESET_CAUSE_RESET_PIN : RESET_CAUSE_UNKNOWN;
}

reset_cause_t reset_cause(void) {
    const uint32_t flags = RCC->CSR;
    RCC->CSR |= RCC_CSR_RMVF;
    return cause_of(flags);
}
