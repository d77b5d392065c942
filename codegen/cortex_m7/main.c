/* Firmware of the processor-in-the-loop test: reads a request, runs the controller, answers.
 *
 * A request is a command word and an mpc_in; an answer is the struct below. Both are exchanged
 * through files "request" and "answer" of the host, which are pipes. A build with BOARD_XCP also
 * serves a calibration tool at the serial line, between the steps.
 */
#include "board.h"
#include "mpc.h"
#if defined(BOARD_XCP)
#include "xcp.h"
#endif

enum {
    COMMAND_INIT = 0,
    COMMAND_DEPART = 1,
    COMMAND_STEP = 2,
    COMMAND_STOP = 3,
    COMMAND_SERVE = 4 /* one command of a calibration tool, in a build with BOARD_XCP */
};

typedef struct {
    int32_t result;       /* return value of the function called */
    uint32_t ticks;       /* taken by it */
    uint32_t idle_ticks;  /* of an empty measurement */
    uint32_t stack_bytes; /* most ever used */
    uint32_t state_bytes; /* sizeof(mpc_state) */
    uint32_t in_bytes;
    uint32_t out_bytes;
    uint32_t padding;
    mpc_out out;
} answer;

static mpc_state state;
static mpc_in in;
static answer reply;

#if defined(BOARD_XCP)
extern uint8_t link_data_start[];
extern uint8_t link_stack_top[];
static xcp_slave tool = {{link_data_start, link_stack_top}, /* all RAM may be read */
                         {(const uint8_t *)&state.calibration, (const uint8_t *)&state.cal},
                         0u,
                         0};
#endif

static int32_t run(uint32_t command)
{
    int32_t result = 0;
    if (command == COMMAND_INIT) {
        mpc_init(&state);
    } else if (command == COMMAND_DEPART) {
        result = mpc_depart(&state, &in);
#if defined(BOARD_XCP)
    } else if (command == COMMAND_SERVE) {
        xcp_serve(&tool);
#endif
    } else {
        result = mpc_step(&state, &in, &reply.out);
    }
    return result;
}

int main(void)
{
    static const char request_name[] = "request";
    static const char answer_name[] = "answer";
    const int32_t requests = board_open_read(request_name, sizeof(request_name) - 1u);
    const int32_t answers = board_open_write(answer_name, sizeof(answer_name) - 1u);
    int32_t result = ((requests < 0) || (answers < 0)) ? -1 : 0;
    uint32_t command = COMMAND_INIT;
    board_start_timer();
#if defined(BOARD_XCP)
    board_open_line();
#endif
    while ((result == 0) && (command != COMMAND_STOP)) {
        result = board_read(requests, &command, sizeof(command));
        if ((result == 0) && (command != COMMAND_STOP)) {
            result = board_read(requests, &in, sizeof(in));
            const uint32_t before = board_ticks();
            const uint32_t start = board_ticks();
            reply.result = run(command);
            const uint32_t end = board_ticks();
            reply.ticks = end - start;
            reply.idle_ticks = start - before;
            reply.stack_bytes = board_stack_used();
            reply.state_bytes = sizeof(mpc_state);
            reply.in_bytes = sizeof(mpc_in);
            reply.out_bytes = sizeof(mpc_out);
            if (result == 0) {
                result = board_write(answers, &reply, sizeof(reply));
            }
        }
    }
    return (result == 0) ? 0 : 1;
}
