/* watchdog.h: which loops must report, how late is too late, and the reaction.
 *
 * Two stages. watchdog_check(), four thousand times a second at the highest priority, finds a loop
 * late and says that the bridge must be off; nothing feeds the independent watchdog (IWDG) after
 * that and it resets the chip, 20 ms later (14 .. 38 ms: its oscillator runs at 17 .. 47 kHz). The
 * bridge is off well before. The IWDG is fed only when every loop has reported since the last time.
 *
 * The 20 kHz loop is excused when it is merely absent: a dead converter is a fault that the drive
 * can still report over CAN (watchdog_current_loop_dead()). A 20 kHz loop that hangs is not absent:
 * it starves the control tick, which is late then.
 *
 * A core that a debugger halts does not feed it either: with the bridge off the IWDG waits for the
 * debugger, with the bridge on it resets the chip. pwm.h has the outputs opened at the halt itself;
 * RM0090 does not specify that (38.16.2), so the watchdog bounds the time in any case.
 */
#ifndef BOWDEN_STM32F405_WATCHDOG_H
#define BOWDEN_STM32F405_WATCHDOG_H

#include <stdbool.h>

typedef enum { LOOP_CURRENT, LOOP_CONTROL, LOOP_MAIN, LOOPS } loop_t;

/* Starts the IWDG; it cannot be stopped. */
void watchdog_start(void);

/* The loop has done its round. */
void watchdog_report(loop_t loop);

/* Once every BOARD_CONTROL_PERIOD_US: is every loop in time? Feeds the IWDG. Once false it stays
 * false. The control tick has 2 ms while the bridge is on; else 10 ms, because taking a new
 * configuration, which is done only then, takes several. */
bool watchdog_check(bool bridge_on);

/* Has the 20 kHz loop not reported for half a millisecond? */
bool watchdog_current_loop_dead(void);

#endif
