/* board.h: the whole contract between a board and the drive.
 *
 * A board (stm32f405, native) owns the hardware. Every BOARD_CONTROL_PERIOD_US it fills a
 * board_sensors_t, calls drive_tick() and carries out the board_actuators_t that comes back. It
 * passes each received CAN frame to drive_receive() and sends what drive_transmit() gives it.
 * The drive calls nothing of the board: data in, data out, so that the same control law runs
 * natively, emulated and on the chip, bit for bit. Integers only.
 */
#ifndef BOWDEN_BOARD_H
#define BOWDEN_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "../meanings.h"

/* Period of the control tick in microseconds: the cable model runs at 4 kHz. */
#define BOARD_CONTROL_PERIOD_US 250

/* A classic CAN data frame with an 11-bit identifier (CiA 301 uses no other). */
typedef struct {
    uint16_t cob_id; /* 0 .. 0x7FF */
    uint8_t length;  /* 0 .. 8 */
    uint8_t data[8]; /* bytes past length are 0 */
} can_frame_t;

/* Bits of board_sensors_t.faults: what the board itself has found. A set bit latches a drive fault.
 */
enum {
    BOARD_FAULT_NONE = 0,
    BOARD_FAULT_OVERCURRENT = 1 << 0,  /* break input or current limit of the bridge */
    BOARD_FAULT_ENCODER = 1 << 1,      /* an encoder wire is broken or its count is implausible */
    BOARD_FAULT_LOAD_CELL = 1 << 2,    /* load-cell reading stuck or out of the converter's range */
    BOARD_FAULT_CLOCK = 1 << 3,        /* crystal failed, running on the internal oscillator */
    BOARD_FAULT_CAN_BUS_OFF = 1 << 4,  /* the controller went bus-off since the last tick */
    BOARD_FAULT_TICK_OVERRUN = 1 << 5, /* the last tick was not finished in its period */
    BOARD_FAULT_RX_OVERRUN = 1 << 6,   /* a received frame was lost */
    BOARD_FAULT_CONVERTER = 1 << 7,    /* no analogue samples, or all inputs read alike */
    BOARD_FAULT_RESTARTED = 1 << 8,    /* first tick after a crash or a reset by the watchdog */
    BOARD_FAULT_CAN_PASSIVE = 1 << 9,  /* error-passive while the bridge is on */
    BOARD_FAULT_CURRENT_MODEL = 1 << 10, /* current does not follow from voltage and speed */
    BOARD_FAULT_CURRENT_ZERO =
        1 << 11,                 /* current with the bridge off, when it is to be switched on */
    BOARD_FAULT_IMAGE = 1 << 29, /* the program in the flash is not the one that was built */
};

/* Most words that a board keeps across power-off. */
#define BOARD_STORE_WORDS 2045

/* Progress of the board's last save. */
typedef enum {
    BOARD_STORE_IDLE, /* nothing given */
    BOARD_STORE_BUSY,
    BOARD_STORE_DONE,
    BOARD_STORE_FAILED,
    BOARD_STORE_FULL, /* no room: the board makes some, silent for up to 2 s; then ask again */
} board_store_t;

/* Does the bus take the frames that the drive gives? */
typedef enum {
    BOARD_BUS_FINE,
    BOARD_BUS_LOST,    /* bus-off, or no node acknowledges */
    BOARD_BUS_DROPPED, /* lost, and in this tick the controller's waiting frames were withdrawn */
} board_bus_t;

/* Samples of the winding's trace, 50 us apart. */
#define BOARD_WINDING_SAMPLES 200

/* The current under an alternating voltage, once it was asked for and is done; else NULL. */
typedef struct {
    const int32_t *trace_ua; /* bit 0: the voltage that is put out from now on is positive */
    int32_t voltage_uv;      /* its magnitude */
} board_winding_t;

/* An encoder's index pulse. Only where it begins in positive direction: there it is sharp. */
typedef struct {
    bool passed;    /* since the last tick */
    int32_t counts; /* of the encoder, there */
} board_index_t;

/* What the board has measured, sampled together at the start of a tick. */
typedef struct {
    uint32_t time_us;             /* free running, wraps after 71 minutes */
    int32_t motor_encoder_counts; /* counted on past turns; + winds cable a */
    int32_t load_encoder_counts;  /* counted on past turns; + is the motion that cable a produces */
    int32_t motor_current_ua;     /* microamperes; + drives theta_m > 0 */
    int32_t load_cell_counts;     /* raw converter counts; + is torque by the cables on the load,
                                     theta_l > 0 */
    int32_t bus_voltage_mv;       /* millivolts */
    int32_t conduit_temperature_mdegc; /* millidegrees Celsius */
    uint32_t faults;                   /* BOARD_FAULT_* bits */
    board_store_t store;
    board_bus_t bus;
    board_winding_t winding; /* a board that cannot: always NULL */
    board_index_t motor_index, load_index;
} board_sensors_t;

/* Where the encoders stand, counted from the zero of the angles: kept by the board over a reset
 * that spares its memory. */
typedef struct {
    bool holds; /* the zero is known, and both encoders have stood still for a while */
    int32_t motor_counts, load_counts;
} board_reference_t;

/* What the board must do until the next tick. Bridge off overrides the current. */
typedef struct {
    int32_t motor_current_ua; /* reference of the current loop, microamperes */
    bool bridge_enabled;      /* false: all switches of the bridge open */
    bool reset_requested;     /* NMT reset node: the board restarts the drive */
    bool winding_test;        /* with the bridge on: trace the winding, no current control */
    /* To be kept across power-off, all or nothing, or NULL. The words stay as they are until
     * `store` of the sensors says done or failed; then NULL comes, and `store` is idle again. */
    const uint32_t *store;
    board_reference_t reference; /* of this tick, to be kept over a reset */
    uint32_t store_words;        /* 1 .. BOARD_STORE_WORDS */
    bool store_is_log;           /* not requested: cut short it is no BOARD_SAVED_DAMAGED */
} board_actuators_t;

/* How the program before this one ended, entry crash_record; all zero when it did not crash since
 * power-on. */
typedef struct {
    uint32_t crashes;         /* since power-on */
    uint32_t cause;           /* number of the exception; 16 + n is interrupt n */
    uint32_t program_counter; /* 0 when unknown */
    uint32_t stack_pointer;
    uint32_t tick; /* control ticks from that program's start to its end */
} board_crash_t;

/* State of the saved data at the start. */
typedef enum {
    BOARD_SAVED_FINE,
    BOARD_SAVED_DAMAGED, /* the last save is damaged: `saved` is older, or nothing */
} board_saved_t;

/* Identity of this board and cause of its start; fixed from power-on. */
typedef struct {
    uint8_t node_id;        /* CANopen node id, 1 .. 127, unless another was stored */
    uint32_t serial_number; /* 0x1018 sub 4; 32 bits of the chip's unique id */
    int32_t current_max_ua; /* the most that its bridge is to drive; 0: it has no such limit */
    reset_cause_t reset;
    board_crash_t crash;
    board_reference_t
        reference;         /* kept; holds only where `reset` and the encoders since allow it */
    const uint32_t *saved; /* what was kept last; read in drive_init() only */
    uint32_t saved_words;  /* 0: nothing */
    board_saved_t saved_state;
} board_identity_t;

#endif
