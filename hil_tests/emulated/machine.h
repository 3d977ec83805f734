/* machine.h: the emulated STM32F405, inside.
 *
 * One struct holds all state; each file of this folder owns one member of it and nothing else of
 * the machine. Register models follow RM0090 (peripherals) and PM0214 (core).
 *
 * Control flow. cpu.c runs blocks of instructions in unicorn. Before each block it lets the due
 * events happen (events.c), and stops when an exception is to be taken. Register accesses
 * (bus.c) only change state and pend interrupts; they never run anything.
 */
#ifndef EMULATED_MACHINE_H
#define EMULATED_MACHINE_H

#include "api.h"
#include "can.h"
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

/* ---- events.c: what happens next, and when ---- */
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
void schedule(machine_t *m, int event, tick_t at);
void events_run(machine_t *m);

/* ---- exceptions.c: NVIC, entry and return ---- */
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

void exception_pend(machine_t *m, int exception);
void irq_level(machine_t *m, int irq, bool asserted);
int exception_takeable(machine_t *m); /* 0: none */
bool exception_wakes(machine_t *m);   /* a pending one would end WFI, PRIMASK aside */
void exception_enter(machine_t *m, int exception);
void exception_return(machine_t *m, uint32_t exc_return);
void exception_fault(machine_t *m, const fault_t *fault);
int execution_priority(const machine_t *m);
void nvic_reset(machine_t *m);
uint32_t scs_read(machine_t *m, uint32_t offset);
void scs_write(machine_t *m, uint32_t offset, uint32_t value, unsigned size);

/* ---- systick.c, mpu.c, account.c ---- */
typedef struct {
    uint32_t csr, rvr;
    uint32_t start_count; /* CVR at start_time */
    tick_t start_time;
    bool running;
    uint64_t cycles_base; /* DWT_CYCCNT = executed cycles - base */
    uint32_t dwt_ctrl;
} systick_t;
uint32_t systick_read(machine_t *m, uint32_t offset);
void systick_write(machine_t *m, uint32_t offset, uint32_t value);
void systick_event(machine_t *m, tick_t at);
void systick_reset(machine_t *m);
void systick_clock_changed(machine_t *m, bool before);

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
bool mpu_permits(const machine_t *m, uint32_t address, int access);
uint32_t mpu_read(machine_t *m, uint32_t offset);
void mpu_write(machine_t *m, uint32_t offset, uint32_t value);
void mpu_changed(machine_t *m); /* registers or active exceptions; takes effect at the next stop */
void mpu_apply(machine_t *m);
void mpu_reset(machine_t *m);

typedef struct {
    account_t exception[EXCEPTIONS];
    uint64_t start[EXCEPTIONS + 1], exclusive[EXCEPTIONS + 1]; /* by depth; 0 is thread mode */
    uint64_t last_switch;
} accounts_t;
void account_enter(machine_t *m);                /* depth has grown */
void account_leave(machine_t *m, int exception); /* before depth shrinks */
void account_sleep(machine_t *m);
void account_wake(machine_t *m);

/* ---- rcc.c, flash.c, pwr.c, iwdg.c ---- */
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
uint32_t rcc_read(machine_t *m, uint32_t offset);
void rcc_write(machine_t *m, uint32_t offset, uint32_t value);
void rcc_event(machine_t *m, tick_t at);
void rcc_reset(machine_t *m, uint32_t cause);
void rcc_hse_changed(machine_t *m);
/* Was its clock enabled so short ago that an access may get lost? */
bool rcc_is_fresh(const machine_t *m, int bus, int bit);
void rcc_start_lsi(machine_t *m); /* what starting the watchdog does */

typedef struct {
    uint32_t acr, sr, cr, optcr;
    int key_step, option_step;
    bool refused;        /* a wrong key: locked until the next reset */
    bool latency_unread; /* set, but not read back yet */
    tick_t busy_until;
    int erase_first, erase_count; /* sectors being erased */
} flash_t;
uint32_t flash_read(machine_t *m, uint32_t offset);
void flash_write(machine_t *m, uint32_t offset, uint32_t value);
void flash_program(machine_t *m, uint32_t address, unsigned size, uint64_t value);
void flash_event(machine_t *m, tick_t at);
void flash_reset(machine_t *m);
void flash_check_latency(machine_t *m);
void flash_check_read_back(machine_t *m);

typedef struct {
    uint32_t cr, csr, supply_mv;
    bool held; /* in reset: the supply is below the brown-out level */
    uint8_t backup[4096];
} pwr_t;
uint32_t pwr_read(machine_t *m, uint32_t offset);
void pwr_write(machine_t *m, uint32_t offset, uint32_t value);
void pwr_reset(machine_t *m);
void pwr_supply_changed(machine_t *m);

typedef struct {
    uint32_t pr, rlr;
    bool running, unlocked;
    tick_t update_done;
    tick_t left; /* to the reset, while frozen by the debugger */
} iwdg_t;
uint32_t iwdg_read(machine_t *m, uint32_t offset);
void iwdg_write(machine_t *m, uint32_t offset, uint32_t value);
void iwdg_event(machine_t *m, tick_t at);
void iwdg_reset(machine_t *m);
void iwdg_freeze(machine_t *m, bool frozen);

/* ---- debug.c ---- */
typedef struct {
    uint32_t cr, apb1_fz, apb2_fz;
    bool halted;
} debug_t;
uint32_t debug_read(const machine_t *m, uint32_t offset);
void debug_write(machine_t *m, uint32_t offset, uint32_t value);
void debug_power_on(machine_t *m);

/* ---- gpio.c, exti.c ---- */
#define PORTS 9
typedef struct {
    uint32_t moder, otyper, ospeedr, pupdr, odr, lckr, afr[2];
    int8_t driven[16]; /* level from outside, -1: not driven */
} gpio_t;
uint32_t gpio_read(machine_t *m, int port, uint32_t offset);
void gpio_write(machine_t *m, int port, uint32_t offset, uint32_t value);
void gpio_reset(machine_t *m);
int gpio_level(const machine_t *m, int port, int pin);
bool gpio_is_alternate(const machine_t *m, int port, int pin, unsigned function);
bool gpio_is_analog(const machine_t *m, int port, int pin);
void gpio_drive(machine_t *m, int port, int pin, int level);

typedef struct {
    uint32_t imr, emr, rtsr, ftsr, pr, exticr[4];
} exti_t;
uint32_t exti_read(machine_t *m, uint32_t offset);
void exti_write(machine_t *m, uint32_t offset, uint32_t value);
uint32_t syscfg_read(machine_t *m, uint32_t offset);
void syscfg_write(machine_t *m, uint32_t offset, uint32_t value);
void exti_edge(machine_t *m, int line, bool rising);
void exti_pin_edge(machine_t *m, int port, int pin, bool rising);
void exti_reset(machine_t *m);

/* ---- tim.c, pwm.c, encoder.c ---- */
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
uint32_t tim_read(machine_t *m, int n, uint32_t offset);
void tim_write(machine_t *m, int n, uint32_t offset, uint32_t value);
void tim_event(machine_t *m, int n, tick_t at);
void tim_trigger_event(machine_t *m, tick_t at);
void tim_reset(machine_t *m, int n);
void tim_clock_changed(machine_t *m, bool before);
void tim_update_irq(machine_t *m, int n);
void tim_freeze(machine_t *m, int n, bool frozen);
bool tim_is_encoder(const tim_t *t);
uint32_t tim_clock_hz(const machine_t *m, int n);
tick_t tim_ticks_per_count(const machine_t *m, int n);

void pwm_write_bdtr(machine_t *m, int n, uint32_t value);
void pwm_write_ccer(machine_t *m, int n, uint32_t value);
void pwm_break_changed(machine_t *m); /* the break pin or the clock-failure line moved */
void pwm_clock_failed(machine_t *m);
void pwm_software_break(machine_t *m);
bool pwm_break_active(const machine_t *m);
double pwm_duty(const machine_t *m, int channel);
bool pwm_leg_switched(const machine_t *m, int channel);
double pwm_dead_time_s(const machine_t *m);
double pwm_frequency_hz(const machine_t *m);

typedef struct {
    int port[3], pin[3]; /* A, B, index; -1: not wired */
    int broken[3];       /* level a broken wire is stuck at, -1: whole */
    int64_t position;
    int counts_per_turn;
    bool wired;
} encoder_t;

/* ---- adc.c, bridge.c ---- */
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
uint32_t adc_read(machine_t *m, uint32_t offset);
void adc_write(machine_t *m, uint32_t offset, uint32_t value);
void adc_event(machine_t *m, int n, tick_t at);
void adc_trigger_injected(machine_t *m, unsigned source, tick_t at);
void adc_reset(machine_t *m);

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
void bridge_advance(machine_t *m, tick_t at); /* call before anything that changes its voltage */
double bridge_sensed_a(machine_t *m);         /* what the current amplifier makes of the current */
void bridge_check_enabled(machine_t *m);      /* and this after it */

/* ---- bus.c: which register model answers an address ---- */
void bus_map(machine_t *m);
/* A rule of the manual that the program broke; a use of what the emulator does not do. */
void note(machine_t *m, const char *format, ...) __attribute__((format(printf, 2, 3)));
void unmodelled(machine_t *m, const char *format, ...) __attribute__((format(printf, 2, 3)));
void bus_fault(machine_t *m, uint32_t address); /* of the running access */

/* ---- cpu.c ---- */
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
bool cpu_open(machine_t *m);
void cpu_reset(machine_t *m);
int cpu_run(machine_t *m);
void cpu_forget_code(machine_t *m); /* the flash has changed */
uint8_t *memory_at(machine_t *m, uint32_t address, uint32_t length);
uint32_t cpu_get(machine_t *m, int reg);
void cpu_set(machine_t *m, int reg, uint32_t value);

/* ---- machine.c ---- */
void request_reset(machine_t *m, uint32_t cause); /* RCC_CSR flag; performed between blocks */
void perform_reset(machine_t *m);
uint64_t ticks_to_ns(tick_t ticks);

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
