/* What both versions of FMI need of an instance beside mpc_instance.h. */
#ifndef MPC_FMI_INSTANCE_H
#define MPC_FMI_INSTANCE_H

#include "mpc_instance.h"

extern const char *const mpc_fmi_categories[4]; /* of messages, by status */

/* A copy of the state, into the memory of an earlier copy if there is one; NULL without memory. */
mpc_instance_state *mpc_fmi_kept(const mpc_instance *instance, mpc_instance_state *earlier);

#endif
