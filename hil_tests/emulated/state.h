/* state.h: all state of the emulated STM32F405, and nothing that acts on it.
 *
 * One struct holds it; each file owns one member and changes nothing else of the machine. Register
 * models follow RM0090 (peripherals) and PM0214 (core). The functions are in layers, each a folder
 * with one header, and a file includes its own layer's header and those below:
 *
 *     system      cpu, register map, order of events, power and reset
 *     board       what is wired to the chip: bridge and motor, encoders, CAN bus
 *     chip        peripherals
 *     core        exceptions, SysTick, MPU, accounts of time
 *     services    notes, schedule, requests for a reset
 *     state.h, ports.h
 *
 * ports.h declares what a lower layer asks of a higher one, which defines it.
 * test_emulated_layers.py holds all of this.
 */
#ifndef EMULATED_STATE_H
#define EMULATED_STATE_H

#include "api.h"
#include "ticks.h"

#include <stddef.h>
#include <unicorn/unicorn.h>

#define FLASH_BASE 0x08000000u
#define FLASH_SIZE 0x00100000u
#define SRAM_BASE 0x20000000u
#define SRAM_SIZE 0x00020000u
#define CCM_BASE 0x10000000u
#define CCM_SIZE 0x00010000u
#define SYSTEM_BASE 0x1FFF0000u /* system memory, OTP, unique id, flash size */
#define SYSTEM_SIZE 0x00010000u

/* ---- system/events.c: what happens next, and when ---- */
enum {
    EVENT_RCC,
    EVENT_FLASH,
    EVENT_SYSTICK,
    EVENT_IWDG,
    EVENT_CAN,
    EVENT_ADC,                     /* three of them */
    EVENT_TIM = EVENT_ADC + 3,     /* nine: TIM1 .. TIM8 and one spare so that TIMn is + n */
    EVENT_TRIGGER = EVENT_TIM + 9, /* TIM1 channel 4 reference goes high */
    EVENT_COUNT
};

/* ---- core/exceptions.c: NVIC, entry and return ---- */
#define EXCEPTIONS 98 /* 16 of the core and 82 of the chip */
enum { NMI = 2, HARD_FAULT, MEM_MANAGE, BUS_FAULT, USAGE_FAULT, SVCALL = 11, PENDSV = 14, SYSTICK };
enum { ATTENTION_EXCEPTION = 1, ATTENTION_STOP = 2, ATTENTION_STALL = 4, ATTENTION_FLASH = 8 };

typedef struct {
    uint64_t pending[2], enabled[2], line[2]; /* one bit an exception; line: level of the request */
    uint8_t priority[EXCEPTIONS];             /* upper four bits */
    uint8_t group_mask;                       /* AIRCR.PRIGROUP: the bits that preempt */
    uint8_t active[EXCEPTIONS];               /* stack of active exceptions */
    int depth;
    bool locked_up;
    uint32_t vtor, scr, ccr, shcsr, aircr_prigroup, cfsr, hfsr, mmfar, bfar, cpacr, demcr;
} nvic_t;

/* A fault that the running instruction met; taken when unicorn has stopped on it. */
typedef struct {
    bool present;
    int exception;
    uint32_t cfsr;
    uint32_t address;
    bool address_valid;
} fault_t;

/* ---- core/systick.c, core/mpu.c, core/account.c ---- */
typedef struct {
    uint32_t csr, rvr;
    uint32_t start_count; /* CVR at start_time */
    tick_t start_time;
    bool running;
    uint64_t cycles_base; /* DWT_CYCCNT = executed cycles - base */
    uint32_t dwt_ctrl;
} systick_t;

#define MPU_REGIONS 8
#define MPU_PAGE 1024u /* unicorn's */
typedef struct {
    machine_t *m;
    uint32_t base;
    bool trapped;
} mpu_page_t;
typedef struct {
    mpu_page_t page[SRAM_SIZE / MPU_PAGE]; /* pages of SRAM of which a part may not be read */
    uint32_t ctrl, rnr, rbar[MPU_REGIONS], rasr[MPU_REGIONS];
    bool active; /* enforced now: enabled, and not inside HardFault or NMI without HFNMIENA */
} mpu_t;
enum { ACCESS_READ = 1, ACCESS_WRITE = 2, ACCESS_FETCH = 4 };

typedef struct {
    account_t exception[EXCEPTIONS];
    uint64_t start[EXCEPTIONS + 1], exclusive[EXCEPTIONS + 1]; /* by depth; 0 is thread mode */
    uint64_t last_switch;
} accounts_t;

/* ---- chip/rcc.c, chip/flash.c, chip/pwr.c, chip/iwdg.c ---- */
typedef struct {
    uint32_t cr, pllcfgr, cfgr, cir, reset[5], enable[5], low_power[5], bdcr, csr;
    tick_t hse_ready_at, pll_ready_at, lsi_ready_at, hsi_ready_at;
    uint32_t fresh[5]; /* enable bits set at fresh_at and not read back since */
    tick_t fresh_at;
    uint32_t hclk_hz, pclk1_hz, pclk2_hz, tim1_hz, tim2_hz; /* timers on APB1 and on APB2 */
    bool hse_works;
} rcc_t;
enum {
    RESET_PIN = 1u << 26,
    RESET_POWER = 1u << 27,
    RESET_SOFTWARE = 1u << 28,
    RESET_IWDG = 1u << 29,
    RESET_BROWN_OUT = 1u << 25
};

typedef struct {
    uint32_t acr, sr, cr, optcr;
    int key_step, option_step;
    bool refused;        /* a wrong key: locked until the next reset */
    bool latency_unread; /* set, but not read back yet */
    tick_t busy_until;
    int erase_first, erase_count; /* sectors being erased */
} flash_t;

typedef struct {
    uint32_t dr;
    uint8_t idr;
} crc_t;

typedef struct {
    uint32_t cr, csr, supply_mv;
    bool held; /* in reset: the supply is below the brown-out level */
    uint8_t backup[4096];
} pwr_t;

typedef struct {
    uint32_t pr, rlr;
    bool running, unlocked;
    tick_t update_done;
    tick_t left; /* to the reset, while frozen by the debugger */
} iwdg_t;

/* ---- chip/debug.c ---- */
typedef struct {
    uint32_t cr, apb1_fz, apb2_fz;
    bool halted;
} debug_t;

/* ---- chip/gpio.c, chip/exti.c ---- */
#define PORTS 9
typedef struct {
    uint32_t moder, otyper, ospeedr, pupdr, odr, lckr, afr[2];
    int8_t driven[16]; /* level from outside, -1: not driven */
} gpio_t;

typedef struct {
    uint32_t imr, emr, rtsr, ftsr, pr, exticr[4];
} exti_t;

/* ---- chip/tim.c, chip/pwm.c, board/encoder.c ---- */
#define TIMERS 9 /* index n is TIMn; 0 unused */
typedef struct {
    uint32_t cr1, cr2, smcr, dier, sr, ccmr[2], ccer, psc, arr, rcr, ccr[4], bdtr;
    uint32_t psc_now, arr_now, ccr_now[4], repeat; /* the shadow registers */
    uint32_t base_count;
    tick_t base_time;
    bool down;
    bool frozen;     /* by the debugger */
    uint32_t locked; /* BDTR.LOCK, write-once after reset */
} tim_t;

typedef struct {
    int port[3], pin[3]; /* A, B, index; -1: not wired */
    int broken[3];       /* level a broken wire is stuck at, -1: whole */
    int64_t position;
    int counts_per_turn;
    bool wired;
} encoder_t;

/* ---- chip/adc.c, board/bridge.c ---- */
typedef struct {
    uint32_t sr, cr1, cr2, smpr[2], jofr[4], htr, ltr, sqr[3], jsqr, dr;
    int32_t jdr[4];
    int regular_rank, injected_rank; /* conversion of the sequence that runs, from 0 */
    bool regular_runs, injected_runs, regular_waits;
    tick_t powered_at;
    int stuck_code;
    bool hung;
} adc_t;
typedef struct {
    adc_t adc[3];
    uint32_t ccr;
    double code[19], noise[19];
    uint64_t random;
} adcs_t;

typedef struct {
    line_fault_t fault;
    double size, held;
    bool holds;
    double past[512];
    unsigned count;
    uint64_t random;
} line_t;

typedef struct {
    bridge_parameters_t parameters;
    line_t sense, voltage;
    bool connected, was_enabled;
    int adc_channel;
    double current_a, charge_c, speed_rad_per_s, bus_voltage_v;
    tick_t time, window_start, off_at;
} bridge_t;

/* ---- chip/bxcan.c, board/can_bus.c ---- */
typedef struct {
    uint32_t tir, tdtr, tdlr, tdhr;
} mailbox_t;
typedef struct {
    uint32_t mcr, msr, tsr, rfr[2], ier, esr, btr, fmr, fm1r, fs1r, ffa1r, fa1r, filter[28][2];
    mailbox_t tx[3], fifo[2][3];
    uint32_t order[3]; /* request order of the mailboxes, for TXFP */
    uint32_t orders;
    int tec, rec;
    tick_t synchronised_at; /* leaves initialisation then */
    tick_t recovered_at;    /* leaves bus-off then */
} bxcan_t;

#define WIRE_QUEUE 256 /* a power of two */
typedef struct {
    wire_frame_t to_node[WIRE_QUEUE], from_node[1024];
    uint32_t to_head, to_tail, from_head, from_tail;
    int fault;
    bool babbling;
    wire_frame_t babble;
    uint32_t babble_idle_bits;
    tick_t babble_ready;
    bool busy; /* a frame is on the wire until EVENT_CAN */
    tick_t frame_end;
    tick_t idle_since; /* the bus may be claimed from here on */
    int sender;        /* mailbox 0..2, or below */
    wire_frame_t frame;
    bool fails;
} can_bus_t;
enum { SENDER_HOST = 3, SENDER_BABBLER };

/* ---- system/cpu.c ---- */
#define BLOCK_CACHE 65536
typedef struct {
    uc_engine *uc;
    uint32_t pc;
    tick_t ticks_per_instruction;
    uint64_t instructions;
    bool sleeping, stopped, stalled; /* stalled: a fetch waits for the flash */
    int interrupt;                   /* unicorn's number of what stopped the core, 0: none */
    uint32_t exc_return;
    tick_t slept;
    struct {
        uint32_t address;
        uint16_t size, count;
    } block[BLOCK_CACHE];
} cpu_t;

/* ---- all of it ---- */

struct machine {
    tick_t now, until, wake_at, next_event;
    uint32_t attention;
    tick_t event_at[EVENT_COUNT];
    cpu_t cpu;
    nvic_t nvic;
    fault_t fault;
    systick_t systick;
    mpu_t mpu;
    accounts_t accounts;
    rcc_t rcc;
    flash_t flash;
    crc_t crc;
    pwr_t pwr;
    iwdg_t iwdg;
    debug_t debug;
    gpio_t gpio[PORTS];
    exti_t exti;
    tim_t tim[TIMERS];
    encoder_t encoder[TIMERS];
    adcs_t adcs;
    bridge_t bridge;
    bxcan_t can;
    can_bus_t can_bus;
    uint32_t reset_cause; /* asked for, 0: none */
    machine_options_t options;
    crash_t crash;
    reset_record_t resets[16];
    int reset_count;
    struct {
        char text[96];
        bool is_unmodelled;
    } notes[64];
    int note_count;
    bool peeking; /* a read for the bench: no side effects */
    uint8_t *flash_memory, *sram, *ccm, *system;
};

#endif
