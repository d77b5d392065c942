/* Start-up of the Cortex-M7: vectors, memory, floating-point unit, then main. */
#include <stdint.h>

#include "board.h"

extern uint32_t link_data_load[];
extern uint32_t link_data_start[];
extern uint32_t link_data_end[];
extern uint32_t link_bss_start[];
extern uint32_t link_bss_end[];
extern uint32_t link_stack_low[];
extern uint32_t link_stack_top[];

int main(void);
void reset_handler(void);
void fault_handler(void);

#define STACK_PATTERN 0xA5A5A5A5u
#define FPU_ACCESS (*(volatile uint32_t *)0xE000ED88u)
#define FPU_FULL_ACCESS 0x00F00000u

/* Memory protection unit: flash of the emulated board is writable memory; this makes writing to it
 * a fault, as on real boards. */
#define MPU_CONTROL (*(volatile uint32_t *)0xE000ED94u)
#define MPU_REGION (*(volatile uint32_t *)0xE000ED98u)
#define MPU_BASE (*(volatile uint32_t *)0xE000ED9Cu)
#define MPU_SIZE (*(volatile uint32_t *)0xE000EDA0u)
#define MPU_ENABLE_WITH_DEFAULT_MAP 5u
#define MPU_READ_ONLY_4_MB ((6u << 24) | (1u << 17) | (21u << 1) | 1u) /* normal memory, cached */

typedef void (*vector)(void);

__attribute__((section(".vectors"), used)) static const vector vectors[16] = {
    (vector)link_stack_top, reset_handler, fault_handler, fault_handler,
    fault_handler,          fault_handler, fault_handler, fault_handler,
    fault_handler,          fault_handler, fault_handler, fault_handler,
    fault_handler,          fault_handler, fault_handler, fault_handler};

__attribute__((noreturn)) void fault_handler(void) { board_exit(BOARD_FAULT); }

__attribute__((noreturn)) void reset_handler(void)
{
    FPU_ACCESS |= FPU_FULL_ACCESS;
    __asm volatile("dsb\n isb" ::: "memory");
    const uint32_t *from = link_data_load;
    for (uint32_t *to = link_data_start; to < link_data_end; to++) {
        *to = *from;
        from++;
    }
    for (uint32_t *to = link_bss_start; to < link_bss_end; to++) {
        *to = 0u;
    }
    MPU_REGION = 0u;
    MPU_BASE = 0u;
    MPU_SIZE = MPU_READ_ONLY_4_MB;
    MPU_CONTROL = MPU_ENABLE_WITH_DEFAULT_MAP;
    __asm volatile("dsb\n isb" ::: "memory");
    board_paint_stack();
    board_exit(main());
}

/* Fill the stack below here with a pattern, to find later how much of it was ever used. */
void board_paint_stack(void)
{
    uint32_t *const here = (uint32_t *)__builtin_frame_address(0);
    for (uint32_t *word = link_stack_low; word < (here - 16); word++) {
        *word = STACK_PATTERN;
    }
}

uint32_t board_stack_used(void)
{
    const uint32_t *word = link_stack_low;
    while ((word < link_stack_top) && (*word == STACK_PATTERN)) {
        word++;
    }
    return (uint32_t)((const uint8_t *)link_stack_top - (const uint8_t *)word);
}
