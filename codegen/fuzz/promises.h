/* What mpc_step promises of every second, whatever it is given. A broken promise aborts. */
#ifndef PROMISES_H
#define PROMISES_H

#include "mpc.h"

#define FLAGS 7 /* bits of mpc_out.flags */

/* Abort with a message and the state's measurements unless `fine`. */
void require(int fine, const char *what, const mpc_state *state, const mpc_out *out);

/* Command in range, status declared and consistent, measurements and calibration used as given unless
 * flagged, and no other command exceeds the limits of the second by less, for those used. */
void check_promises(const mpc_state *state, const mpc_in *in, const mpc_out *out, int32_t returned);

#endif
