/* In place of Simulink's file at the end of an S-function: calls its functions in Simulink's order, for a
 * caller in Python. */
static void stub_enter(SimStruct *S, int phase, double time_s)
{
    S->phase = phase;
    S->time_s = time_s;
}

/* A block: its sizes and sample time, and memory with anything in it, as nobody has cleared it. */
SimStruct *stub_block(const mxArray *parameters, int count)
{
    SimStruct *const S = (SimStruct *)calloc(1, sizeof *S);
    S->parameters = parameters;
    S->parameter_count = count;
    stub_enter(S, IN_SIZES, 0.0);
    mdlInitializeSizes(S);
    stub_require(S, S->expected_parameters == count, "stub: number of parameters");
    for (int i = 0; (i < S->dwork_count) && (S->error == NULL); i++) {
        const size_t bytes = (size_t)S->dwork[i].width * sizeof(double);
        stub_require(S, (S->dwork[i].type == SS_DOUBLE) && (bytes > 0U), "stub: work vector");
        S->dwork[i].memory = malloc(bytes);
        memset(S->dwork[i].memory, 0xA5, bytes);
    }
    if (S->error == NULL) {
        stub_enter(S, IN_TIMES, 0.0);
        mdlInitializeSampleTimes(S);
    }
    return S;
}

void stub_start(SimStruct *S)
{
    stub_enter(S, IN_CONDITIONS, 0.0);
    S->stop_requested = 0;
#ifdef MDL_START
    mdlStart(S);
#endif
#ifdef MDL_INITIALIZE_CONDITIONS
    mdlInitializeConditions(S);
#endif
}

void stub_outputs(SimStruct *S, double time_s)
{
    stub_enter(S, IN_OUTPUTS, time_s);
    mdlOutputs(S, 0);
}

void stub_update(SimStruct *S, double time_s)
{
    stub_enter(S, IN_UPDATE, time_s);
#ifdef MDL_UPDATE
    mdlUpdate(S, 0);
#endif
}

void stub_end(SimStruct *S)
{
    stub_enter(S, IN_END, 0.0);
    if (S->dwork_count > 0 && S->dwork[0].memory != NULL) {
        mdlTerminate(S);
    }
    for (int i = 0; i < S->dwork_count; i++) {
        free(S->dwork[i].memory);
    }
    free(S);
}

void stub_set(SimStruct *S, int port, double value)
{
    stub_port *const to = &S->port[0][port];
    if (to->type == SS_DOUBLE) {
        to->signal.real = value;
    } else if (to->type == SS_SINGLE) {
        to->signal.single = (real32_T)value;
    } else if (to->type == SS_INT32) {
        to->signal.integer = (int32_T)value;
    } else {
        to->signal.boolean = (boolean_T)(value != 0.0);
    }
}

double stub_get(const SimStruct *S, int port)
{
    const stub_port *const from = &S->port[1][port];
    double value = from->signal.real;
    if (from->type == SS_SINGLE) {
        value = (double)from->signal.single;
    } else if (from->type == SS_INT32) {
        value = (double)from->signal.integer;
    } else if (from->type == SS_BOOLEAN) {
        value = (double)from->signal.boolean;
    }
    return value;
}

/* Of a port: width, type, feedthrough; -1 where there is none. */
int stub_about(const SimStruct *S, int side, int port, int what)
{
    const stub_port *const of = &S->port[side][port];
    const int about[3] = {of->width, of->type, of->feedthrough};
    return (port < S->port_count[side]) ? about[what] : -1;
}

double stub_sample_time_s(const SimStruct *S)
{
    return (S->offset_s == 0.0) ? S->sample_time_s : -1.0;
}
void *stub_memory(const SimStruct *S) { return S->dwork[0].memory; }
int stub_words(const SimStruct *S) { return S->dwork[0].width; }
const char *stub_error(const SimStruct *S) { return S->error; }
const char *stub_warning(const SimStruct *S) { return S->warning; }
int stub_stop_requested(const SimStruct *S) { return S->stop_requested; }
