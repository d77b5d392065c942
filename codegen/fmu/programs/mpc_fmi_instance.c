/* What both versions of FMI need: names of log categories, saved states. */
#include "mpc_fmi_instance.h"

#include <stdlib.h>

const char *const mpc_fmi_categories[4] = {"", "logStatusWarning", "logStatusDiscard",
                                           "logStatusError"};

mpc_instance_state *mpc_fmi_kept(const mpc_instance *instance, mpc_instance_state *earlier)
{
    mpc_instance_state *const kept =
        (earlier != NULL) ? earlier : (mpc_instance_state *)calloc(1, sizeof(mpc_instance_state));
    if (kept != NULL) {
        *kept = instance->state;
    }
    return kept;
}
