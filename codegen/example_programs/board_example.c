/* The controller on a board with a Cortex-M7: order of calls, cycles, stack, a log.
 *
 * Registers are those of the core, the same on every Cortex-M7. The parts to replace are marked
 * YOURS. It builds with the project's start-up and linker script (`make example`), and with yours.
 * QEMU runs it, but does not have the cycle counter, which stays at 0 there.
 */
#include "mpc_forecast.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* Floating-point unit: access to coprocessors 10 and 11. */
#define CPACR REGISTER(0xE000ED88u)
#define CPACR_FPU 0x00F00000u

/* Cycle counter of the debug unit. */
#define DEMCR REGISTER(0xE000EDFCu)
#define DEMCR_TRACE 0x01000000u
#define DWT_CTRL REGISTER(0xE0001000u)
#define DWT_CTRL_CYCCNT 1u
#define DWT_CYCCNT REGISTER(0xE0001004u)
#define DWT_LAR REGISTER(0xE0001FB0u) /* some parts lock the debug unit */
#define DWT_UNLOCK 0xC5ACCE55u

/* Timer of the core, polled, without interrupts. */
#define SYST_CSR REGISTER(0xE000E010u)
#define SYST_RVR REGISTER(0xE000E014u)
#define SYST_CVR REGISTER(0xE000E018u)
#define SYST_ON 5u /* from the core's clock, no interrupt */
#define SYST_PASSED 0x00010000u
#define TICKS_PER_SECOND 100u
#ifndef CORE_HZ
#define CORE_HZ 25000000u /* YOURS */
#endif

#define STACK_PATTERN 0xA5A5A5A5u
#define STACK_SPARED_WORDS 16

/* YOURS: the ends of the stack, by their names in your linker script. */
extern uint32_t link_stack_low[];
extern uint32_t link_stack_top[];

/* YOURS: memory with no wait states, e.g. __attribute__((section(".dtcm"))). */
#define FAST_MEMORY

static FAST_MEMORY mpc_state state;
static mpc_forecast forecast;
static mpc_in in;
static mpc_out out;

/* YOURS: the trip, from the navigation system. */
#define TRIP_S 20
static mpc_real demand_w[TRIP_S];
static mpc_real speed_mps[TRIP_S];

/* The last seconds, for the debugger or to be sent out. From the inputs of all seconds, sent
 * unchanged, the host library drives the trip again. */
#define LOG_LENGTH 64
typedef struct {
    uint32_t forecast_cycles;
    uint32_t step_cycles;
    uint32_t stack_bytes;
    mpc_out out;
} log_entry;
static volatile log_entry second_log[LOG_LENGTH];
static volatile uint32_t depart_cycles; /* of the longest slice */

int main(void);

static void enable_fpu(void)
{
    CPACR |= CPACR_FPU;
    __asm volatile("dsb\n isb" ::: "memory");
}

static void start_cycle_counter(void)
{
    DEMCR |= DEMCR_TRACE;
    DWT_LAR = DWT_UNLOCK;
    DWT_CYCCNT = 0u;
    DWT_CTRL |= DWT_CTRL_CYCCNT;
}

static void start_timer(void)
{
    SYST_RVR = (CORE_HZ / TICKS_PER_SECOND) - 1u;
    SYST_CVR = 0u;
    SYST_CSR = SYST_ON;
}

/* YOURS: an interrupt or a task of the operating system instead. */
static void wait_for_second(void)
{
    for (uint32_t tick = 0u; tick < TICKS_PER_SECOND; tick++) {
        while ((SYST_CSR & SYST_PASSED) == 0u) {
        }
    }
}

/* Fill the free stack with a pattern, to find later how much of it was ever used. */
static void paint_stack(void)
{
    uint32_t *const here = (uint32_t *)__builtin_frame_address(0);
    for (uint32_t *word = link_stack_low; word < (here - STACK_SPARED_WORDS); word++) {
        *word = STACK_PATTERN;
    }
}

static uint32_t stack_used(void)
{
    const uint32_t *word = link_stack_low;
    while ((word < link_stack_top) && (*word == STACK_PATTERN)) {
        word++;
    }
    return (uint32_t)((const uint8_t *)link_stack_top - (const uint8_t *)word);
}

/* YOURS: battery and coolant from the car's bus, demand from the pedals, speed from the wheels. */
static void read_sensors(int32_t step)
{
    in.soc = (mpc_real)0.6;
    in.t_cl_degc = (mpc_real)50.0;
    in.demand_w = demand_w[step];
    in.speed_mps = speed_mps[step];
    in.engine_on = out.engine_on;
#if MPC_LEARNING
    in.fuel_g = (mpc_real)0.0; /* no such sensor here: nothing is learned */
#endif
}

/* YOURS: out.engine_on and out.p_eng_w to the engine's controller. */
static void command_engine(void) {}

/* YOURS: here a launch with 1 m/s^2 on the level. */
static void plan_trip(void)
{
    for (int32_t k = 0; k < TRIP_S; k++) {
        speed_mps[k] = (mpc_real)k + (mpc_real)0.5;
        demand_w[k] = mpc_demand_w(speed_mps[k], (mpc_real)1.0, (mpc_real)0.0);
    }
}

/* Before the trip; at most a few seconds, in slices between which other work may run. Returns 0, or
 * -1 if the trip is refused: then no step has a preview, and the rules drive. */
static int32_t depart(void)
{
    const mpc_road trip = {demand_w, speed_mps, TRIP_S};
    const int32_t result = mpc_forecast_start(&forecast, &trip);
    mpc_init(&state);
    (void)mpc_in_from_forecast(&forecast, 0, &in);
    read_sensors(0);
    int32_t left = 1;
    while (left > 0) {
        const uint32_t start = DWT_CYCCNT;
        left = mpc_depart(&state, &in);
        const uint32_t cycles = DWT_CYCCNT - start;
        depart_cycles = (cycles > depart_cycles) ? cycles : depart_cycles;
    }
    return result;
}

/* Once a second. */
static void decide(int32_t step)
{
    const uint32_t start = DWT_CYCCNT;
    (void)mpc_in_from_forecast(&forecast, step, &in);
    read_sensors(step);
    const uint32_t filled = DWT_CYCCNT;
    (void)mpc_step(&state, &in, &out);
    const uint32_t decided = DWT_CYCCNT;
    command_engine();
    volatile log_entry *const entry = &second_log[step % LOG_LENGTH];
    entry->forecast_cycles = filled - start;
    entry->step_cycles = decided - filled;
    entry->stack_bytes = stack_used();
    entry->out = out;
}

int main(void)
{
    enable_fpu(); /* best in the reset handler, before any code that the compiler may vectorise */
    start_cycle_counter();
    paint_stack();
    plan_trip();
    int32_t result = depart();
    start_timer();
    for (int32_t step = 0; step < TRIP_S; step++) {
        wait_for_second();
        decide(step);
        result |= out.flags;
    }
    return (result == 0) ? 0 : 1;
}
