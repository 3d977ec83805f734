/* api.h: Python interface of the emulated STM32F405.
 *
 * hil_tests/emulated/library.py hands this very file to cffi (it drops the lines that begin
 * with '#'), so there is one declaration of each function. Times are microseconds of virtual
 * time since power-on. Channels, timers and pins are numbered as in the reference manual RM0090;
 * ports are 0 for GPIOA, 1 for GPIOB and so on.
 */
#ifndef EMULATED_API_H
#define EMULATED_API_H

#include <stdbool.h>
#include <stdint.h>

typedef struct machine machine_t;

/* Fixed properties of one board and its chip. */
typedef struct {
    uint32_t hse_hz; /* crystal on OSC_IN/OSC_OUT; 8 MHz */
    uint32_t lsi_hz; /* the watchdog's oscillator; 32 kHz, silicon 17..47 kHz */
    uint32_t cycles_per_instruction_x1000; /* 1000: one core cycle an instruction */
    uint32_t can_bitrate;                  /* of the other nodes on the bus */
    uint32_t unique_id[3];                 /* 0x1FFF7A10 */
    uint32_t seed;                         /* of SRAM contents at power-on and of ADC noise */
    bool frozen_timer_drives; /* TIM1 stopped by a debugger keeps its outputs; see debug.c */
} machine_options_t;

/* One CAN data frame on the wire. */
typedef struct {
    uint64_t time_ns; /* end of frame, virtual time */
    uint32_t id;      /* 11 or 29 bits */
    uint8_t extended; /* 1: 29-bit identifier */
    uint8_t remote;
    uint8_t length; /* 0 .. 8 */
    uint8_t data[8];
} wire_frame_t;

/* Instructions of one exception, since the last accounting reset. Number 0 is thread mode: there
 * an activation runs from one wake-up to the next WFI. Exclusive leaves out what preempted it. */
typedef struct {
    uint64_t activations;
    uint64_t total_exclusive;
    uint64_t worst_exclusive;
    uint64_t total_inclusive;
    uint64_t worst_inclusive;
    uint32_t last_exclusive;
    uint32_t last_inclusive;
} account_t;

/* The H-bridge on TIM1 channels 1 and 2 as the motor sees it. */
typedef struct {
    bool enabled;        /* MOE set and both legs switched by their timer channel */
    double duty_a;       /* fraction of the period that leg A (CH1) is high */
    double duty_b;       /* leg B (CH2) */
    double current_a;    /* motor current at this moment, ampere, + drives theta_m > 0 */
    double mean_a;       /* its mean since the last call */
    double frequency_hz; /* of the switching */
    double dead_time_s;
} bridge_state_t;

/* The motor's electrical side; see hil_tests/emulated/bridge.py. */
typedef struct {
    double resistance_ohm;
    double inductance_h;
    double back_emf_v_s_per_rad;
    double diode_drop_v;
    double ampere_per_code; /* of the current amplifier, at the converter's 12 bits */
    double zero_code;
} bridge_parameters_t;

/* What is broken on an analogue line; see hil_tests/emulated/bridge.py. */
typedef enum {
    LINE_SOUND,
    LINE_STUCK,  /* at `size` */
    LINE_FROZEN, /* at the last value */
    LINE_OFFSET, /* by `size` */
    LINE_GAIN,   /* times `size` */
    LINE_SIGN,
    LINE_NOISE,   /* uniform, `size` its standard deviation */
    LINE_DROPOUT, /* every other value at random is 0 */
    LINE_LATE,    /* by `size` values, at most 511 */
} line_fault_t;

/* Why the core restarted, and where. */
typedef struct {
    uint64_t time_us;
    uint32_t cause; /* the RCC_CSR flags that reset set */
} reset_record_t;

/* The first fault exception since power-on or the last call of machine_clear_crash(). */
typedef struct {
    bool happened;
    bool lockup;        /* a fault inside HardFault: the core stands still */
    uint32_t exception; /* 3 HardFault, 4 MemManage, 5 BusFault, 6 UsageFault */
    uint32_t pc;        /* of the instruction at fault */
    uint32_t address;   /* of the access, 0 if there is none */
    uint32_t cfsr, hfsr;
    uint64_t time_us;
} crash_t;

enum {
    FAULT_CAN_NONE = 0,
    FAULT_CAN_NO_ACK,     /* no other node on the bus: every frame lacks its acknowledge */
    FAULT_CAN_CORRUPT_TX, /* each frame of the node is destroyed by a bit error */
    FAULT_CAN_CORRUPT_RX, /* each frame to the node arrives with a CRC error */
    FAULT_CAN_DOMINANT,   /* CAN_H and CAN_L shorted so that the bus stays dominant */
};

/* Only these are visible: unicorn has symbols of the same short names as ours. */
#pragma GCC visibility push(default)
machine_t *machine_new(const machine_options_t *options);
void machine_free(machine_t *m);
/* Puts bytes into the flash before power-on (what a programmer does). False: not in the flash. */
bool machine_load(machine_t *m, uint32_t address, const uint8_t *data, uint32_t length);
void machine_power_on(machine_t *m);
void machine_pin_reset(machine_t *m); /* NRST pulled low */

/* Runs to the given virtual time. 0: reached. -1: the emulator met what it does not model; then
 * the last note says what. */
int machine_run_until(machine_t *m, double time_us);
double machine_time_us(const machine_t *m);
uint64_t machine_instructions(const machine_t *m);
uint64_t machine_core_hz(const machine_t *m);
uint64_t machine_sleep_ns(const machine_t *m); /* time spent in WFI since power-on */

bool machine_read_memory(machine_t *m, uint32_t address, uint8_t *data, uint32_t length);
bool machine_write_memory(machine_t *m, uint32_t address, const uint8_t *data, uint32_t length);
uint32_t machine_register(machine_t *m, uint32_t number); /* r0 .. r12, sp, lr, pc, 16: xpsr */
uint32_t machine_peek(machine_t *m, uint32_t address); /* a peripheral register, without effects */

/* Rules of the manual that the program broke, or what it used that is not modelled; each once. */
int machine_note_count(const machine_t *m);
const char *machine_note(const machine_t *m, int index);
bool machine_note_is_unmodelled(const machine_t *m, int index);
crash_t machine_crash(const machine_t *m);
void machine_clear_crash(machine_t *m);
int machine_reset_count(const machine_t *m);
reset_record_t machine_reset_record(const machine_t *m, int index); /* the last 16 are kept */

account_t machine_account(const machine_t *m, uint32_t exception); /* 0 .. 97 */
void machine_account_reset(machine_t *m);

/* Pins. An encoder is wired once: A and B to two pins, an index pulse (port -1: none) to a third.
 */
void machine_wire_encoder(machine_t *m, int timer, int port_a, int pin_a, int port_b, int pin_b,
                          int index_port, int index_pin, int counts_per_turn);
void machine_set_encoder(machine_t *m, int timer, int64_t counts);
/* line 0 A, 1 B, 2 index; level 0 or 1: broken and stuck there, -1: whole. */
void machine_break_encoder_wire(machine_t *m, int timer, int line, int level);
void machine_set_pin(machine_t *m, int port, int pin, int level); /* -1: not driven */
int machine_pin(const machine_t *m, int port, int pin);           /* level that the pin shows */

/* Analogue inputs in 12-bit codes of full scale, fractions allowed; channels 0 .. 18. */
void machine_set_analog(machine_t *m, int channel, double code, double noise_codes);
void machine_stick_adc(machine_t *m, int adc, int code); /* every conversion reads it; -1: whole */
void machine_hang_adc(machine_t *m, int adc, bool hung); /* conversions never end */

void machine_connect_bridge(machine_t *m, int adc_channel, const bridge_parameters_t *parameters);
void machine_set_motor(machine_t *m, double speed_rad_per_s, double bus_voltage_v);
/* Breaks what the converter sees of the current (A), or the bridge's mean voltage (V), from now on;
 * a value of the one comes with each conversion, of the other with each change of the duty. */
void machine_break_current_sense(machine_t *m, line_fault_t fault, double size);
void machine_break_bridge_voltage(machine_t *m, line_fault_t fault, double size);
bridge_state_t machine_bridge(machine_t *m);
uint64_t machine_bridge_off_ns(const machine_t *m); /* when the bridge last went from on to off */

bool machine_can_send(machine_t *m, const wire_frame_t *frame); /* false: queue of 256 is full */
bool machine_can_receive(machine_t *m, wire_frame_t *frame);
void machine_can_fault(machine_t *m, int fault);
/* A node that sends this frame back to back, with idle_bits between; NULL: stop. */
void machine_can_babble(machine_t *m, const wire_frame_t *frame, uint32_t idle_bits);

void machine_halt(machine_t *m, bool halted); /* by a debugger: no instruction, no interrupt */
/* Requests an exception from outside: taken before the next block of instructions. */
void machine_pend(machine_t *m, uint32_t exception);

void machine_hse_works(machine_t *m, bool works);
void machine_supply_mv(machine_t *m, uint32_t millivolt); /* of the chip; 3300 */

#pragma GCC visibility pop

#endif
