/* machine.c: one board: power, reset, time, and the bench's windows into memory. */
#include "system.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

machine_t *machine_new(const machine_options_t *options) {
    machine_t *m = calloc(1, sizeof *m);
    if (m == NULL) {
        return NULL;
    }
    m->options = *options;
    m->flash_memory = aligned_alloc(4096, FLASH_SIZE);
    m->sram = aligned_alloc(4096, SRAM_SIZE);
    m->ccm = aligned_alloc(4096, CCM_SIZE);
    m->system = aligned_alloc(4096, SYSTEM_SIZE);
    memset(m->flash_memory, 0xFF, FLASH_SIZE);
    memset(m->system, 0xFF, SYSTEM_SIZE);
    memcpy(m->system + 0x7A10, options->unique_id, 12);
    const uint16_t flash_kib = FLASH_SIZE / 1024;
    memcpy(m->system + 0x7A22, &flash_kib, 2);
    m->flash.optcr = 0x0FFFAAEDu;
    m->pwr.supply_mv = 3300;
    m->rcc.hse_works = true;
    m->next_event = NEVER;
    for (int i = 0; i < EVENT_COUNT; i++) {
        m->event_at[i] = NEVER;
    }
    for (int port = 0; port < PORTS; port++) {
        memset(m->gpio[port].driven, -1, sizeof m->gpio[port].driven);
    }
    for (int n = 0; n < 3; n++) {
        m->adcs.adc[n].stuck_code = -1;
    }
    m->adcs.random = 0x9E3779B97F4A7C15ull ^ options->seed;
    if (!cpu_open(m)) {
        machine_free(m);
        return NULL;
    }
    return m;
}

void machine_free(machine_t *m) {
    if (m->cpu.uc != NULL) {
        uc_close(m->cpu.uc);
    }
    free(m->flash_memory);
    free(m->sram);
    free(m->ccm);
    free(m->system);
    free(m);
}

bool machine_load(machine_t *m, uint32_t address, const uint8_t *data, uint32_t length) {
    if (address < FLASH_BASE || length > FLASH_SIZE || address - FLASH_BASE > FLASH_SIZE - length) {
        return false;
    }
    memcpy(m->flash_memory + (address - FLASH_BASE), data, length);
    cpu_forget_code(m);
    return true;
}

void perform_reset(machine_t *m) {
    uint32_t cause = m->reset_cause;
    m->reset_cause = 0;
    can_bus_drop_node(m);
    if (m->rcc.hclk_hz != 0) {
        bridge_advance(m, m->now);
        tim_reset(m, 1); /* the outputs go first */
    }
    flash_reset(m);
    rcc_reset(m, cause);
    crc_reset(m);
    pwr_reset(m);
    for (int n = 1; n < TIMERS; n++) {
        tim_reset(m, n);
    }
    adc_reset(m);
    bxcan_reset(m);
    iwdg_reset(m);
    gpio_reset(m);
    exti_reset(m);
    nvic_reset(m);
    systick_reset(m);
    mpu_reset(m);
    m->accounts.start[0] = m->cpu.instructions;
    m->accounts.exclusive[0] = 0;
    m->accounts.last_switch = m->cpu.instructions;
    cpu_reset(m);
    m->resets[m->reset_count++ % 16] = (reset_record_t){m->now / TICKS_PER_US, m->rcc.csr};
}

/* SRAM holds anything after power-on; a program that relies on zeros must be seen to fail. */
static void scramble(machine_t *m, uint8_t *memory, uint32_t size) {
    uint32_t state = 0x12345678u ^ m->options.seed;
    for (uint32_t i = 0; i < size; i++) {
        state = state * 1664525u + 1013904223u;
        memory[i] = (uint8_t)(state >> 24);
    }
}

void machine_power_on(machine_t *m) {
    scramble(m, m->sram, SRAM_SIZE);
    scramble(m, m->ccm, CCM_SIZE);
    debug_power_on(m);
    m->reset_cause = RESET_POWER;
    perform_reset(m);
}

void machine_pin_reset(machine_t *m) {
    request_reset(m, RESET_PIN);
}

int machine_run_until(machine_t *m, double time_us) {
    double whole = floor(time_us);
    m->until =
        (tick_t)whole * TICKS_PER_US + (tick_t)llround((time_us - whole) * (double)TICKS_PER_US);
    return cpu_run(m);
}

double machine_time_us(const machine_t *m) {
    return (double)m->now / (double)TICKS_PER_US;
}

uint64_t machine_instructions(const machine_t *m) {
    return m->cpu.instructions;
}

uint64_t machine_core_hz(const machine_t *m) {
    return m->rcc.hclk_hz;
}

uint64_t machine_sleep_ns(const machine_t *m) {
    return ticks_to_ns(m->cpu.slept);
}

bool machine_read_memory(machine_t *m, uint32_t address, uint8_t *data, uint32_t length) {
    const uint8_t *memory = memory_at(m, address, length);
    if (memory != NULL) {
        memcpy(data, memory, length);
    }
    return memory != NULL;
}

bool machine_write_memory(machine_t *m, uint32_t address, const uint8_t *data, uint32_t length) {
    uint8_t *memory = memory_at(m, address, length);
    if (memory != NULL) {
        memcpy(memory, data, length);
        cpu_forget_code(m);
    }
    return memory != NULL;
}

uint32_t machine_register(machine_t *m, uint32_t number) {
    static const int registers[17] = {
        UC_ARM_REG_R0,  UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3, UC_ARM_REG_R4,  UC_ARM_REG_R5,
        UC_ARM_REG_R6,  UC_ARM_REG_R7, UC_ARM_REG_R8, UC_ARM_REG_R9, UC_ARM_REG_R10, UC_ARM_REG_R11,
        UC_ARM_REG_R12, UC_ARM_REG_SP, UC_ARM_REG_LR, UC_ARM_REG_PC, UC_ARM_REG_XPSR};
    return number == 15 ? m->cpu.pc : number < 17 ? cpu_get(m, registers[number]) : 0;
}

int machine_note_count(const machine_t *m) {
    return m->note_count;
}

const char *machine_note(const machine_t *m, int index) {
    return index >= 0 && index < m->note_count ? m->notes[index].text : "";
}

bool machine_note_is_unmodelled(const machine_t *m, int index) {
    return index >= 0 && index < m->note_count && m->notes[index].is_unmodelled;
}

crash_t machine_crash(const machine_t *m) {
    return m->crash;
}

void machine_clear_crash(machine_t *m) {
    m->crash = (crash_t){0};
}

int machine_reset_count(const machine_t *m) {
    return m->reset_count;
}

reset_record_t machine_reset_record(const machine_t *m, int index) {
    static const reset_record_t none;
    bool kept = index >= 0 && index < m->reset_count && m->reset_count - index <= 16;
    return kept ? m->resets[index % 16] : none;
}

void machine_pend(machine_t *m, uint32_t exception) {
    if (exception < EXCEPTIONS) {
        exception_pend(m, (int)exception);
    }
}

void machine_hse_works(machine_t *m, bool works) {
    if (m->rcc.hse_works != works) {
        m->rcc.hse_works = works;
        if (m->rcc.hclk_hz != 0) {
            rcc_hse_changed(m);
        }
    }
}

void machine_supply_mv(machine_t *m, uint32_t millivolt) {
    m->pwr.supply_mv = millivolt;
    pwr_supply_changed(m);
}
