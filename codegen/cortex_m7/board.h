/* The firmware's interface to the board: QEMU's mps2-an500, a Cortex-M7 at 25 MHz. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

#define BOARD_FAULT 3

/* Files of the host, through semihosting. Handles and counts below 0 are failures. */
int32_t board_open_read(const char *name, uint32_t length);
int32_t board_open_write(const char *name, uint32_t length);
int32_t board_read(int32_t handle, void *data, uint32_t size);
int32_t board_write(int32_t handle, const void *data, uint32_t size);
__attribute__((noreturn)) void board_exit(int32_t code);

/* Timer of 40 ns per tick, counting up. QEMU with -icount shift=6 takes 64 ns per instruction. */
void board_start_timer(void);
uint32_t board_ticks(void);

/* Serial line, CMSDK UART0; each waits. */
void board_open_line(void);
uint8_t board_receive(void);
void board_send(uint8_t byte);

void board_paint_stack(void);
uint32_t board_stack_used(void);

#endif
