/* crash.c: see crash.h. PM0214 2.3.7 (exception entry), 4.3 (fault status). */
#include "crash.h"

#include "handlers.h"
#include "pwm.h"
#include "registers.h"

#define MAGIC 0xB0DE0C4Au
#define SRAM_BEGIN 0x20000000u
#define SRAM_END 0x20020000u
#define FRAME_WORDS 8u

extern crash_record_t crash_record;
__attribute__((section(".noinit"))) crash_record_t crash_record;

static uint32_t now_tick;

/* Its own stack: the main one may be what overflowed. */
#define CRASH_STACK_WORDS 64
__attribute__((used)) static uint64_t crash_stack[CRASH_STACK_WORDS / 2];

__attribute__((used)) _Noreturn void crash_keep(const uint32_t *frame);

static uint32_t check(const crash_record_t *record) {
    const uint32_t *words = &record->magic;
    uint32_t sum = 0x5EED5EEDu;
    for (uint32_t i = 0; i < sizeof *record / 4u - 1u; i++) {
        sum = (sum << 5 | sum >> 27) ^ words[i];
    }
    return sum;
}

static bool is_valid(const crash_record_t *record) {
    return record->magic == MAGIC && record->check == check(record);
}

/* TIM1_BDTR.MOE to 0 first (0x40010044, bit 15), then a stack that is sound. */
__attribute__((naked)) void crash_handler(void) {
    __asm volatile("movw r1, #0x0044\n"
                   "movt r1, #0x4001\n"
                   "ldr r2, [r1]\n"
                   "bic r2, r2, #0x8000\n"
                   "str r2, [r1]\n"
                   "cpsid i\n"
                   "mov r0, sp\n"
                   "ldr r1, =%c[stack]\n"
                   "mov sp, r1\n"
                   "b crash_keep\n" ::[stack] "i"(crash_stack + CRASH_STACK_WORDS / 2));
}

_Noreturn void crash_keep(const uint32_t *frame) {
    const uintptr_t at = (uintptr_t)frame;
    const bool readable = at >= SRAM_BEGIN && at <= SRAM_END - 4u * FRAME_WORDS && (at & 3u) == 0;
    uint32_t exception;
    __asm volatile("mrs %0, ipsr" : "=r"(exception));
    crash_record = (crash_record_t){
        .magic = MAGIC,
        .count = is_valid(&crash_record) ? crash_record.count + 1u : 1u,
        .exception = exception,
        .pc = readable ? frame[6] : 0u,
        .lr = readable ? frame[5] : 0u,
        .sp = (uint32_t)at,
        .cfsr = SCB->CFSR,
        .hfsr = SCB->HFSR,
        .mmfar = SCB->MMFAR,
        .bfar = SCB->BFAR,
        .tick = now_tick,
        .fresh = 1,
    };
    crash_record.check = check(&crash_record);
    crash_restart();
}

bool crash_is_news(void) {
    const bool news = is_valid(&crash_record) && crash_record.fresh != 0;
    if (news) {
        crash_record.fresh = 0;
        crash_record.check = check(&crash_record);
    }
    return news;
}

board_crash_t crash_report(void) {
    if (!is_valid(&crash_record)) {
        return (board_crash_t){0};
    }
    return (board_crash_t){
        .crashes = crash_record.count,
        .cause = crash_record.exception,
        .program_counter = crash_record.pc,
        .stack_pointer = crash_record.sp,
        .tick = crash_record.tick,
    };
}

void crash_note_tick(uint32_t tick) {
    now_tick = tick;
}

_Noreturn void crash_restart(void) {
    pwm_lock();
    core_barrier();
    SCB->AIRCR = SCB_AIRCR_VECTKEY | SCB_AIRCR_SYSRESETREQ;
    core_barrier();
    for (;;) { /* the reset comes within a few cycles, or the watchdog's does */
    }
}
