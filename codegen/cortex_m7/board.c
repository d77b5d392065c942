/* Semihosting, the CMSDK timer and its serial line. */
#include "board.h"

enum { SYS_OPEN = 0x01, SYS_WRITE = 0x05, SYS_READ = 0x06, SYS_EXIT_EXTENDED = 0x20 };
enum { MODE_READ_BINARY = 1, MODE_WRITE_BINARY = 5 };
#define STOPPED_BY_APPLICATION 0x20026u

typedef struct {
    volatile uint32_t control;
    volatile uint32_t value;
    volatile uint32_t reload;
} cmsdk_timer;

typedef struct {
    volatile uint32_t data;
    volatile uint32_t state;
    volatile uint32_t control;
    volatile uint32_t interrupts;
    volatile uint32_t divider;
} cmsdk_uart;

#define UART ((cmsdk_uart *)0x40004000u)
#define UART_FULL 1u     /* to be sent */
#define UART_RECEIVED 2u /* to be read */
#define UART_BOTH_WAYS 3u
#define UART_DIVIDER 217u /* 115200 of 25 MHz */

#define TIMER ((cmsdk_timer *)0x40000000u)
#define TIMER_ENABLE 1u

static int32_t call_host(uint32_t operation, const uint32_t *arguments)
{
    register uint32_t r0 __asm("r0") = operation;
    register const uint32_t *r1 __asm("r1") = arguments;
    __asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return (int32_t)r0;
}

static int32_t open_file(const char *name, uint32_t length, uint32_t mode)
{
    const uint32_t arguments[3] = {(uint32_t)name, mode, length};
    return call_host(SYS_OPEN, arguments);
}

int32_t board_open_read(const char *name, uint32_t length)
{
    return open_file(name, length, MODE_READ_BINARY);
}

int32_t board_open_write(const char *name, uint32_t length)
{
    return open_file(name, length, MODE_WRITE_BINARY);
}

/* Read all of `size`; the host may deliver it in parts. Returns 0, or -1 at the end of the file. */
int32_t board_read(int32_t handle, void *data, uint32_t size)
{
    uint32_t left = size;
    int32_t result = 0;
    while ((left > 0u) && (result == 0)) {
        const uint32_t arguments[3] = {(uint32_t)handle, (uint32_t)data + (size - left), left};
        const uint32_t missing = (uint32_t)call_host(SYS_READ, arguments);
        if (missing >= left) {
            result = -1;
        } else {
            left = missing;
        }
    }
    return result;
}

int32_t board_write(int32_t handle, const void *data, uint32_t size)
{
    const uint32_t arguments[3] = {(uint32_t)handle, (uint32_t)data, size};
    return (call_host(SYS_WRITE, arguments) == 0) ? 0 : -1;
}

void board_exit(int32_t code)
{
    const uint32_t arguments[2] = {STOPPED_BY_APPLICATION, (uint32_t)code};
    (void)call_host(SYS_EXIT_EXTENDED, arguments);
    for (;;) {
    }
}

void board_open_line(void)
{
    UART->divider = UART_DIVIDER;
    UART->control = UART_BOTH_WAYS;
}

uint8_t board_receive(void)
{
    while ((UART->state & UART_RECEIVED) == 0u) {
    }
    return (uint8_t)UART->data;
}

void board_send(uint8_t byte)
{
    while ((UART->state & UART_FULL) != 0u) {
    }
    UART->data = byte;
}

void board_start_timer(void)
{
    TIMER->reload = 0xFFFFFFFFu;
    TIMER->value = 0xFFFFFFFFu;
    TIMER->control = TIMER_ENABLE;
}

uint32_t board_ticks(void) { return 0xFFFFFFFFu - TIMER->value; }
