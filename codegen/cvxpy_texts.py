"""Texts of a project that cvxpygen has no part in, and what is changed in its own."""

PROGRAM_H = """/* The program of one second: all parameters in, the plan out. */
#ifndef PROGRAM_H
#define PROGRAM_H
#define PROGRAM_PARAMETERS {parameters}
#define PROGRAM_STAGES {stages}
#define PROGRAM_VARIABLES {variables}
/* Returns QOCO's status, 1 or 2 with a plan. Variable by variable, in units of the table below:
{table} */
int program_solve(const double *given, double *plan, int *iterations);
#endif
"""

PROGRAM_C = """#include "program.h"
#include "cpg_solve.h"
#include "cpg_workspace.h"

int program_solve(const double *given, double *plan, int *iterations)
{{
    int i;
{updates}
    if (qoco_solver != NULL) {{
        /* a second solution with the same solver is wrong in QOCO as cvxpygen 1.0.2 ships it */
        qoco_cleanup(qoco_solver);
        qoco_solver = NULL;
    }}
    cpg_solve();
{copies}
    *iterations = (int)CPG_Result.info->iter;
    return (int)CPG_Result.info->status;
}}
"""

# What the CMake of QOCO and QDLDL would write, for a compiler alone.
CONFIGURED = {
    "solver_code/include/qoco_config.h": """#ifndef QOCO_CONFIG_H
#define QOCO_CONFIG_H
#ifdef __APPLE__
#define IS_MACOS
#else
#define IS_LINUX
#endif
#define QOCO_VERSION_MAJOR 0 /* printed in its header alone */
#define QOCO_VERSION_MINOR 0
#define QOCO_VERSION_PATCH 0
#endif
""",
    "solver_code/lib/qdldl/include/qdldl_types.h": """#ifndef QDLDL_TYPES_H
#define QDLDL_TYPES_H
#include <limits.h>
typedef int QDLDL_int;
typedef double QDLDL_float;
typedef unsigned char QDLDL_bool;
#define QDLDL_INT_MAX INT_MAX
#endif
""",
    "solver_code/lib/qdldl/include/qdldl_version.h": "/* of cvxpygen */\n",
}

# The solver is set up anew each second (see PROGRAM_C), so what it is set up from must not stay
# allocated. It is copied, and needed in that block alone.
CORRECTED = {
    "(QOCOCscMatrix*)malloc(sizeof(QOCOCscMatrix))": "&(QOCOCscMatrix){0}",
    "(QOCOSettings*)malloc(sizeof(QOCOSettings))": "&(QOCOSettings){0}",
}

MAKEFILE = """# libprogram.a: the program of one second. C99 with the timers of POSIX.
CFLAGS ?= -O2 -std=gnu99
INCLUDE := {include}
SOURCES := {sources}
libprogram.a: $(SOURCES:.c=.o)
\t$(AR) rcs $@ $^
%.o: %.c
\t$(CC) $(CFLAGS) $(INCLUDE) -c $< -o $@
clean:
\trm -f libprogram.a $(SOURCES:.c=.o)
"""


NOTICE = """src and include were written by cvxpygen (Apache-2.0) from a program of qpmpc (same);
allocations in cpg_solve.c are changed. solver_code is QOCO (BSD-3-Clause) with QDLDL (Apache-2.0)
and AMD (BSD-3-Clause), as cvxpygen has them; qoco_config.h, qdldl_types.h and qdldl_version.h are
the product's own.
"""
