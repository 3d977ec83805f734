/* erase.c: see erase.h. */
#include "erase.h"

#include "flash.h"
#include "protection.h"
#include "registers.h"

#define HEARTBEAT_PERIODS (50000u / BOARD_CONTROL_PERIOD_US)

/* Turns of 3 or 4 cycles between two looks at the flash: 100 us, less than a control period. */
#define PAUSE_TURNS 4000u

/* Runs in SRAM and calls nothing: whatever it needs is in a register or an argument. */
__attribute__((section(".sram_code"), noinline, long_call)) static uint32_t
wait_in_sram(uint32_t identifier, uint32_t state) {
    uint32_t periods = 0;
    FLASH->CR |= FLASH_CR_STRT;
    while ((FLASH->SR & FLASH_SR_BSY) != 0 && periods < ERASE_PERIODS_MAX) {
        for (uint32_t turn = 0; turn < PAUSE_TURNS; turn++) {
            core_order();
        }
        IWDG->KR = IWDG_KR_RELOAD;
        if ((SYSTICK->CTRL & SYSTICK_CTRL_COUNTFLAG) == 0) {
            continue;
        }
        periods++;
        if (periods % HEARTBEAT_PERIODS == 0 && (CAN1->TSR & CAN_TSR_TME0) != 0) {
            CAN1->MAILBOX[0].TDTR = 1;
            CAN1->MAILBOX[0].TDLR = state;
            CAN1->MAILBOX[0].TIR = identifier;
        }
    }
    return periods;
}

uint32_t erase_sector(uint32_t sector, const can_frame_t *heartbeat) {
    core_mask();
    flash_prepare_erase(sector);
    protection_open_sram_code(true);
    const uint32_t periods =
        wait_in_sram(CAN_IR_STID(heartbeat->cob_id) | CAN_TIR_TXRQ, heartbeat->data[0]);
    protection_open_sram_code(false);
    flash_finish_erase();
    core_unmask();
    return periods;
}
