/* The replay on Linux: an Arm board, or any other machine. The log goes to standard output.
 *
 * Time is that of the clock, interruptions by the system included: quiet the machine, and see p99
 * and the maximum beside the median.
 */
#define _POSIX_C_SOURCE 200112L
#include <stdio.h>
#include <sys/utsname.h>
#include <time.h>

#include "replay.h"
#include "replay_port.h"

#define NAME_LENGTH 41

static char name[NAME_LENGTH];

const char *port_name(void) { return name; }

const char *port_unit(void) { return "ns"; }

uint32_t port_hz(void) { return 0u; }

void port_start(void)
{
    struct utsname system;
    const char *const machine = (uname(&system) == 0) ? system.machine : "unknown";
    /* YOURS: the board's name, 1 to 40 letters, digits, spaces, . _ - */
    (void)snprintf(name, sizeof(name), "linux %.30s", machine);
}

uint32_t port_ticks(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)(((uint64_t)now.tv_sec * 1000000000u) + (uint64_t)now.tv_nsec);
}

uint32_t port_units(uint32_t ticks) { return ticks; }

void port_write(const char *text, uint32_t length)
{
    (void)fwrite(text, 1u, length, stdout);
    (void)fflush(stdout);
}

void port_next_second(void) {}

uint32_t port_stack_bytes(void) { return 0u; }

uint32_t port_flash_bytes(void) { return 0u; }

uint32_t port_ram_bytes(void) { return 0u; }

int main(void)
{
    port_start();
    return ((replay_run() == 0) && (ferror(stdout) == 0)) ? 0 : 1;
}
