/* What the replay needs of a board: replay_port.c, the one file to edit. */
#ifndef REPLAY_PORT_H
#define REPLAY_PORT_H

#include <stdint.h>

/* Name for the log: letters, digits, spaces, dots, dashes, underscores; at most 40. */
const char *port_name(void);

/* What port_ticks counts: "cycles" of the core, "ns", or "instructions" of an emulator. */
const char *port_unit(void);

/* Cycles per second; 0 if not known, or if the unit is another. */
uint32_t port_hz(void);

/* Clock, caches, counter, serial line. */
void port_start(void);

/* Counter that runs freely, up, modulo 2^32; a step must take less than one turn. */
uint32_t port_ticks(void);

/* Ticks to the unit above. */
uint32_t port_units(uint32_t ticks);

/* Send bytes; may wait until they are on their way. Not called while anything is measured. */
void port_write(const char *text, uint32_t length);

/* Before each second. Empty: the trip is replayed as fast as it goes. */
void port_next_second(void);

/* Most stack ever used, flash and static RAM of the whole program, bytes; 0: not known. */
uint32_t port_stack_bytes(void);
uint32_t port_flash_bytes(void);
uint32_t port_ram_bytes(void);

#endif
