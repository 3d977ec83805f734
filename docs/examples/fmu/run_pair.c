/* Runs the FMU of `bowden export-fmu` (torque-position) from C, without any tool: a motor torque
 * that ramps up, the load held. Prints time, motor torque, load torque, motor angle as CSV.
 *
 *     unzip pair.fmu -d pair
 *     cc run_pair.c -I FMI_HEADERS -ldl -o run_pair
 *     LD_PRELOAD=libpython3.11.so ./run_pair pair/binaries/x86_64-linux/BowdenPair.so \
 *         TOKEN $PWD/pair/resources
 *
 * FMI_HEADERS: the folder of fmi3Functions.h (fmi-standard.org, or `fmpy/c-code` of the package
 * FMPy). TOKEN: instantiationToken in pair/modelDescription.xml. The value references are those of
 * that file: 1 motor_torque_nm, 2 load_angle_rad, 3 load_torque_nm, 4 motor_angle_rad. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi3FunctionTypes.h"

enum { STEPS = 1000 };
static const double STEP_S = 1e-3;
static const double PEAK_NM = 0.7;

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        fprintf(stderr, "no %s in the FMU\n", name);
        exit(1);
    }
    return found;
}

static void say(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                fmi3String message) {
    (void)environment;
    fprintf(stderr, "FMU (%d, %s): %s\n", (int)status, category, message);
}

int main(int count, char **arguments) {
    if (count != 4) {
        fprintf(stderr, "usage: %s LIBRARY TOKEN RESOURCES_PATH\n", arguments[0]);
        return 2;
    }
    library = dlopen(arguments[1], RTLD_LAZY | RTLD_GLOBAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    fmi3InstantiateCoSimulationTYPE *instantiate = function("fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter = function("fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = function("fmi3ExitInitializationMode");
    fmi3SetFloat64TYPE *set = function("fmi3SetFloat64");
    fmi3GetFloat64TYPE *get = function("fmi3GetFloat64");
    fmi3DoStepTYPE *step = function("fmi3DoStep");
    fmi3TerminateTYPE *terminate = function("fmi3Terminate");
    fmi3FreeInstanceTYPE *release = function("fmi3FreeInstance");

    fmi3Instance pair = instantiate("pair", arguments[2], arguments[3], fmi3False, fmi3True,
                                    fmi3False, fmi3False, NULL, 0, NULL, say, NULL);
    const fmi3ValueReference inputs[] = {1, 2}, outputs[] = {3, 4};
    double given[] = {0.0, 0.0}, found[2];
    fmi3Boolean event, over, early;
    double last_s;
    if (pair == NULL || enter(pair, fmi3False, 0.0, 0.0, fmi3False, 0.0) != fmi3OK ||
        set(pair, inputs, 2, given, 2) != fmi3OK || leave(pair) != fmi3OK) {
        return 1;
    }
    printf("time_s,motor_torque_nm,load_torque_nm,motor_angle_rad\n");
    for (int i = 0; i < STEPS; i++) {
        given[0] = PEAK_NM * (i + 1) / STEPS;
        if (set(pair, inputs, 2, given, 2) != fmi3OK ||
            step(pair, i * STEP_S, STEP_S, fmi3True, &event, &over, &early, &last_s) != fmi3OK ||
            get(pair, outputs, 2, found, 2) != fmi3OK) {
            return 1;
        }
        printf("%.9g,%.9g,%.9g,%.9g\n", (i + 1) * STEP_S, given[0], found[0], found[1]);
    }
    terminate(pair);
    release(pair);
    /* Not return: the unit ends its Python when it is unloaded, and libraries that Python has
     * loaded (libgfortran of scipy) fail when the process then unloads them. */
    fflush(stdout);
    _Exit(0);
}
