/* The replay on a board with a Cortex-M7: the one file to edit. What is YOURS is marked.
 *
 * With -DREPLAY_VENDOR=1 it needs nothing of this project's start-up and linker script, and has no
 * main: call port_start and then replay_run from that of your vendor's project.
 * Registers of the core are the same on every Cortex-M7. With -DREPLAY_QEMU=1 this is the port for
 * QEMU's mps2-an500, which has no cycle counter and no caches: there a timer counts instructions.
 */
#include "replay.h"
#include "replay_identity.h"
#include "replay_port.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))

#ifndef REPLAY_QEMU
#define REPLAY_QEMU 0
#endif

#ifndef REPLAY_VENDOR
#define REPLAY_VENDOR 0
#endif

#if !REPLAY_VENDOR
#include "board.h"
#endif

#if REPLAY_QEMU

#define NAME "mps2-an500 in QEMU"
#define UART_DATA REGISTER(0x40004000u)
#define UART_STATUS REGISTER(0x40004004u)
#define UART_MASK 0x1u /* transmit buffer full */
#define UART_READY 0x0u
#define UART_CONTROL REGISTER(0x40004008u)
#define UART_TRANSMIT 0x1u
#define UART_DIVISOR REGISTER(0x40004010u)
#define UART_LEAST_DIVISOR 16u
#define NS_PER_TICK 40u        /* of the machine's time */
#define NS_PER_INSTRUCTION 64u /* with -icount shift=6 */

#else

#define NAME "my board" /* YOURS: 1 to 40 letters, digits, spaces, . _ - */

/* YOURS: cycles per second of the core, if `--clock-mhz` did not say it. 0: not known. */
#ifndef CORE_HZ
#define CORE_HZ REPLAY_CORE_HZ
#endif

/* YOURS: a byte may be written to UART_DATA as soon as UART_STATUS & UART_MASK is UART_READY. These
 * are of USART3 of ST's STM32F7 and H7 (their NUCLEO boards' USB serial line). Others:
 * docs/embedded.md of qpmpc. */
#define UART_DATA REGISTER(0x40004828u)
#define UART_STATUS REGISTER(0x4000481Cu)
#define UART_MASK 0x80u /* transmit buffer empty */
#define UART_READY 0x80u

#endif

/* Cycle counter of the debug unit. */
#define DEMCR REGISTER(0xE000EDFCu)
#define DEMCR_TRACE 0x01000000u
#define DWT_CTRL REGISTER(0xE0001000u)
#define DWT_CTRL_CYCCNT 1u
#define DWT_CYCCNT REGISTER(0xE0001004u)
#define DWT_LAR REGISTER(0xE0001FB0u) /* some parts lock the debug unit */
#define DWT_UNLOCK 0xC5ACCE55u

/* Caches. Sets and ways of the data cache are those of CCSIDR. */
#define CCR REGISTER(0xE000ED14u)
#define CCR_DATA_CACHE 0x00010000u
#define CCR_INSTRUCTION_CACHE 0x00020000u
#define CCSIDR REGISTER(0xE000ED80u)
#define CSSELR REGISTER(0xE000ED84u)
#define ICIALLU REGISTER(0xE000EF50u)
#define DCISW REGISTER(0xE000EF60u)
#define WAY_SHIFT 30u /* 4 ways, as every Cortex-M7 has */
#define SET_SHIFT 5u  /* lines of 32 bytes */

static void barrier(void) { __asm volatile("dsb\n isb" ::: "memory"); }

static void enable_instruction_cache(void)
{
    barrier();
    ICIALLU = 0u;
    barrier();
    CCR |= CCR_INSTRUCTION_CACHE;
    barrier();
}

static void enable_data_cache(void)
{
    CSSELR = 0u;
    barrier();
    const uint32_t last_set = (CCSIDR >> 13) & 0x7FFFu;
    const uint32_t last_way = (CCSIDR >> 3) & 0x3u;
    for (uint32_t set = 0u; set <= last_set; set++) {
        for (uint32_t way = 0u; way <= last_way; way++) {
            DCISW = (way << WAY_SHIFT) | (set << SET_SHIFT);
        }
    }
    barrier();
    CCR |= CCR_DATA_CACHE;
    barrier();
}

static void start_cycle_counter(void)
{
    DEMCR |= DEMCR_TRACE;
    DWT_LAR = DWT_UNLOCK;
    DWT_CYCCNT = 0u;
    DWT_CTRL |= DWT_CTRL_CYCCNT;
}

/* YOURS: clock of the core and wait states of the flash; clock, pins and speed of the serial line.
 * Nothing to do where your vendor's own start-up has done all that. */
static void start_board(void)
{
#if REPLAY_QEMU
    board_start_timer();
    UART_DIVISOR = UART_LEAST_DIVISOR;
    UART_CONTROL = UART_TRANSMIT;
#endif
}

const char *port_name(void) { return NAME; }

#if REPLAY_QEMU

const char *port_unit(void) { return "instructions"; }

uint32_t port_hz(void) { return 0u; }

uint32_t port_ticks(void) { return board_ticks(); }

uint32_t port_units(uint32_t ticks)
{
    return (uint32_t)(((uint64_t)ticks * NS_PER_TICK) / NS_PER_INSTRUCTION);
}

#else

const char *port_unit(void) { return "cycles"; }

uint32_t port_hz(void) { return CORE_HZ; }

uint32_t port_ticks(void) { return DWT_CYCCNT; }

uint32_t port_units(uint32_t ticks) { return ticks; }

#endif

/* Caches that a vendor's start-up has enabled stay: to invalidate one in use would lose data. */
void port_start(void)
{
    start_board();
    if ((CCR & CCR_INSTRUCTION_CACHE) == 0u) {
        enable_instruction_cache();
    }
    if ((CCR & CCR_DATA_CACHE) == 0u) {
        enable_data_cache();
    }
    start_cycle_counter();
}

void port_write(const char *text, uint32_t length)
{
    for (uint32_t k = 0u; k < length; k++) {
        while ((UART_STATUS & UART_MASK) != UART_READY) {
        }
        UART_DATA = (uint32_t)(unsigned char)text[k];
    }
}

/* YOURS: to measure as in a car, wait here for a tick of 1 Hz and let other tasks use the caches. */
void port_next_second(void) {}

#if REPLAY_VENDOR

uint32_t port_stack_bytes(void) { return 0u; }

uint32_t port_flash_bytes(void) { return 0u; }

uint32_t port_ram_bytes(void) { return 0u; }

#else

extern uint32_t link_flash_start[];
extern uint32_t link_data_load[];
extern uint32_t link_data_start[];
extern uint32_t link_data_end[];
extern uint32_t link_bss_start[];
extern uint32_t link_bss_end[];

int main(void);

uint32_t port_stack_bytes(void) { return board_stack_used(); }

uint32_t port_flash_bytes(void)
{
    const uint32_t initial = (uint32_t)link_data_end - (uint32_t)link_data_start;
    return ((uint32_t)link_data_load - (uint32_t)link_flash_start) + initial;
}

uint32_t port_ram_bytes(void)
{
    const uint32_t initial = (uint32_t)link_data_end - (uint32_t)link_data_start;
    return initial + ((uint32_t)link_bss_end - (uint32_t)link_bss_start);
}

#if !REPLAY_QEMU
/* After the trip, and after a fault: the log then ends before its last line. */
void board_exit(int32_t code)
{
    (void)code;
    for (;;) {
    }
}
#endif

int main(void)
{
    port_start();
    return replay_run();
}

#endif
