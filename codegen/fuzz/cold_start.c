/* A trip with variables that nothing has written before, for MemorySanitizer. */
#include "drive.h"

int main(void)
{
    static const uint8_t some[64] = {1, 7, 0, 3, 2, 1, 0, 5, 9};
    source from = {some, sizeof some};
    mpc_state state;
    mpc_out out;
    mpc_in in;
    drive trip;
    place_car(&trip, &from);
    take_road(&trip, &from);
    mpc_init(&state);
    measure(&trip, &in);
    while (mpc_depart(&state, &in) > 0) {
    }
    for (int k = 0; k < 100 && !has_arrived(&trip); k++) {
        measure(&trip, &in);
        if (k % 10 == 9) {
            in.short_count = 0;
        }
        const int32_t flags = mpc_step(&state, &in, &out);
        if ((flags & ~MPC_BAD_PREVIEW) != 0 || !(out.on_share >= 0)) {
            return 1;
        }
        move(&trip, &out, 1);
    }
    return 0;
}
