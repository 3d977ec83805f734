/* chip.h: the peripherals. */
#ifndef EMULATED_CHIP_H
#define EMULATED_CHIP_H

#include "core/core.h"

/* ---- adc.c ---- */
uint32_t adc_read(machine_t *m, uint32_t offset);
void adc_write(machine_t *m, uint32_t offset, uint32_t value);
void adc_event(machine_t *m, int n, tick_t at);
void adc_trigger_injected(machine_t *m, unsigned source, tick_t at);
void adc_reset(machine_t *m);

/* ---- bxcan.c ---- */
uint32_t bxcan_read(machine_t *m, uint32_t offset);
void bxcan_write(machine_t *m, uint32_t offset, uint32_t value);
void bxcan_reset(machine_t *m);
void bxcan_update(machine_t *m);
bool bxcan_on_bus(machine_t *m);
int bxcan_best_mailbox(const machine_t *m); /* -1: none */
uint32_t bxcan_bitrate(const machine_t *m);
void bxcan_sent(machine_t *m, int mailbox, bool ok, bool arbitration_lost);
void bxcan_received(machine_t *m, const wire_frame_t *frame);
void bxcan_tx_error(machine_t *m, int mailbox, int code, bool counts);
void bxcan_rx_error(machine_t *m, int code);
wire_frame_t mailbox_frame(const mailbox_t *box);

/* ---- can_filter.c ---- */
int can_filter_find(const bxcan_t *c, const wire_frame_t *f, int *fifo); /* -1: refused */
uint32_t can_filter_word(const wire_frame_t *f);                         /* as RIxR holds it */
void can_filter_write(machine_t *m, uint32_t offset, uint32_t value);
uint32_t can_filter_read(const bxcan_t *c, uint32_t offset);

/* ---- crc.c ---- */
uint32_t crc_read(const machine_t *m, uint32_t offset);
void crc_write(machine_t *m, uint32_t offset, uint32_t value);
void crc_reset(machine_t *m);

/* ---- debug.c ---- */
uint32_t debug_read(const machine_t *m, uint32_t offset);
void debug_write(machine_t *m, uint32_t offset, uint32_t value);
void debug_power_on(machine_t *m);

/* ---- exti.c ---- */
uint32_t exti_read(machine_t *m, uint32_t offset);
void exti_write(machine_t *m, uint32_t offset, uint32_t value);
uint32_t syscfg_read(machine_t *m, uint32_t offset);
void syscfg_write(machine_t *m, uint32_t offset, uint32_t value);
void exti_edge(machine_t *m, int line, bool rising);
void exti_pin_edge(machine_t *m, int port, int pin, bool rising);
void exti_reset(machine_t *m);

/* ---- flash.c ---- */
uint32_t flash_read(machine_t *m, uint32_t offset);
void flash_write(machine_t *m, uint32_t offset, uint32_t value);
void flash_program(machine_t *m, uint32_t address, unsigned size, uint64_t value);
void flash_event(machine_t *m, tick_t at);
void flash_reset(machine_t *m);
void flash_check_latency(machine_t *m);
void flash_check_read_back(machine_t *m);

/* ---- gpio.c ---- */
uint32_t gpio_read(machine_t *m, int port, uint32_t offset);
void gpio_write(machine_t *m, int port, uint32_t offset, uint32_t value);
void gpio_reset(machine_t *m);
int gpio_level(const machine_t *m, int port, int pin);
bool gpio_is_alternate(const machine_t *m, int port, int pin, unsigned function);
bool gpio_is_analog(const machine_t *m, int port, int pin);
void gpio_drive(machine_t *m, int port, int pin, int level);

/* ---- iwdg.c ---- */
uint32_t iwdg_read(machine_t *m, uint32_t offset);
void iwdg_write(machine_t *m, uint32_t offset, uint32_t value);
void iwdg_event(machine_t *m, tick_t at);
void iwdg_reset(machine_t *m);
void iwdg_freeze(machine_t *m, bool frozen);

/* ---- pwm.c ---- */
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

/* ---- pwr.c ---- */
uint32_t pwr_read(machine_t *m, uint32_t offset);
void pwr_write(machine_t *m, uint32_t offset, uint32_t value);
void pwr_reset(machine_t *m);
void pwr_supply_changed(machine_t *m);

/* ---- rcc.c ---- */
uint32_t rcc_read(machine_t *m, uint32_t offset);
void rcc_write(machine_t *m, uint32_t offset, uint32_t value);
void rcc_event(machine_t *m, tick_t at);
void rcc_reset(machine_t *m, uint32_t cause);
void rcc_hse_changed(machine_t *m);
/* Was its clock enabled so short ago that an access may get lost? */
bool rcc_is_fresh(const machine_t *m, int bus, int bit);
void rcc_start_lsi(machine_t *m); /* what starting the watchdog does */

/* ---- tim.c ---- */
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

#endif
