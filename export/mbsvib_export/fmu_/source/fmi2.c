/* FMI 2.0, model exchange and co-simulation. */
#include "fmi.h"
#include "lti.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ANY (INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED)
#define READ (INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED)
#define WRITE (INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP)

/* the instance, or an error where the call is not due */
#define ENTER(modes) Instance *s = c; if (!allowed(s, modes, __func__)) return FAULT
#define RETURN(wrong) do { const char *w = (wrong); return w ? (fail(s, __func__, w), FAULT) : OK; } while (0)

/* no text has a % in it, so that importers which cannot format read it as it is */
static void log_2(Instance *s, const char *text)
{
    const Callbacks *callbacks = s->log;
    if (callbacks && callbacks->logger)
        callbacks->logger(callbacks->componentEnvironment, s->name, FAULT, "logStatusError", text);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT Status fmi2SetDebugLogging(void *c, int on, size_t count, const char *const categories[])
{
    (void)on; (void)count; (void)categories;
    return c ? OK : FAULT;
}

EXPORT void *fmi2Instantiate(const char *name, Kind kind, const char *guid, const char *folder, const Callbacks *callbacks,
                             int visible, int logging)
{
    const char *wrong;
    Instance *s = instance_new(folder, guid, name, &wrong);
    (void)visible; (void)logging;
    if (!s) {
        char text[256];
        snprintf(text, sizeof text, "fmi2Instantiate: resources/model.lti: %s", wrong);
        if (callbacks && callbacks->logger)
            callbacks->logger(callbacks->componentEnvironment, name ? name : "", FAULT, "logStatusError", text);
        return NULL;
    }
    s->log = (void *)callbacks;
    s->logger = log_2;
    s->cosimulation = kind != 0;
    return s;
}

EXPORT void fmi2FreeInstance(void *c) { instance_free(c); }

EXPORT Status fmi2SetupExperiment(void *c, int tolerant, double tolerance, double start, int stops, double stop)
{
    ENTER(INSTANTIATED);
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    if (!isfinite(start)) RETURN("the start time is not finite");
    s->t = start;
    return OK;
}

EXPORT Status fmi2EnterInitializationMode(void *c) { ENTER(INSTANTIATED); s->mode = INITIALIZATION; return OK; }

EXPORT Status fmi2ExitInitializationMode(void *c)
{
    ENTER(INITIALIZATION);
    const char *wrong = refresh(s);
    if (!wrong) s->mode = s->cosimulation ? STEP : EVENT;
    RETURN(wrong);
}

EXPORT Status fmi2Terminate(void *c) { ENTER(EVENT | CONTINUOUS | STEP); s->mode = TERMINATED; return OK; }
EXPORT Status fmi2Reset(void *c) { ENTER(ANY); instance_reset(s); return OK; }

EXPORT Status fmi2GetReal(void *c, const unsigned vr[], size_t count, double v[]) { ENTER(READ); RETURN(get_values(s, vr, count, v)); }
EXPORT Status fmi2SetReal(void *c, const unsigned vr[], size_t count, const double v[]) { ENTER(WRITE); RETURN(set_values(s, vr, count, v)); }

/* there are no variables of the other types */
#define NONE_OF(NAME, TYPE) \
    EXPORT Status fmi2Get##NAME(void *c, const unsigned vr[], size_t count, TYPE v[]) \
    { ENTER(READ); (void)vr; (void)v; RETURN(count ? "all variables are real" : NULL); } \
    EXPORT Status fmi2Set##NAME(void *c, const unsigned vr[], size_t count, const TYPE v[]) \
    { ENTER(WRITE); (void)vr; (void)v; RETURN(count ? "all variables are real" : NULL); }
typedef const char *Text;
NONE_OF(Integer, int)
NONE_OF(Boolean, int)
NONE_OF(String, Text)

EXPORT Status fmi2GetFMUstate(void *c, void **state)
{
    ENTER(ANY);
    if (!state) RETURN("there is no place for the state");
    if (!*state) *state = malloc(snapshot_size(s));
    if (!*state) RETURN("memory is short");
    snapshot_write(s, *state);
    return OK;
}

EXPORT Status fmi2SetFMUstate(void *c, void *state)
{
    ENTER(ANY);
    if (!state) RETURN("there is no state");
    snapshot_read(s, state);
    return OK;
}

EXPORT Status fmi2FreeFMUstate(void *c, void **state)
{
    ENTER(ANY);
    if (state) { free(*state); *state = NULL; }
    return OK;
}

EXPORT Status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size)
{
    ENTER(ANY);
    (void)state;
    ANSWER(size, snapshot_size(s));
    return OK;
}

EXPORT Status fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size)
{
    ENTER(ANY);
    if (!state || !bytes || size < snapshot_size(s)) RETURN("there is no state, or no room for it");
    memcpy(bytes, state, snapshot_size(s));
    return OK;
}

EXPORT Status fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state)
{
    ENTER(ANY);
    const char *wrong = snapshot_check(s, (const unsigned char *)bytes, size);
    if (!wrong && !state) wrong = "there is no place for the state";
    if (!wrong && !*state && !(*state = malloc(size))) wrong = "memory is short";
    if (!wrong) memcpy(*state, bytes, size);
    RETURN(wrong);
}

EXPORT Status fmi2GetDirectionalDerivative(void *c, const unsigned unknowns[], size_t nu, const unsigned knowns[], size_t nk,
                                           const double seed[], double result[])
{
    ENTER(READ);
    RETURN(directional(s, unknowns, nu, knowns, nk, seed, result));
}

/* Model exchange */
EXPORT Status fmi2EnterEventMode(void *c) { ENTER(CONTINUOUS | EVENT); s->mode = EVENT; return OK; }

EXPORT Status fmi2NewDiscreteStates(void *c, EventInfo *info)
{
    ENTER(EVENT);
    if (info) memset(info, 0, sizeof *info);
    return OK;
}

EXPORT Status fmi2EnterContinuousTimeMode(void *c) { ENTER(EVENT); s->mode = CONTINUOUS; return OK; }

EXPORT Status fmi2CompletedIntegratorStep(void *c, int final, int *event, int *stop)
{
    ENTER(CONTINUOUS);
    (void)final;
    ANSWER(event, 0);
    ANSWER(stop, 0);
    return OK;
}

EXPORT Status fmi2SetTime(void *c, double time)
{
    ENTER(EVENT | CONTINUOUS);
    if (!isfinite(time)) RETURN("the time is not finite");
    s->t = time;
    return OK;
}

EXPORT Status fmi2SetContinuousStates(void *c, const double x[], size_t count) { ENTER(EVENT | CONTINUOUS); RETURN(set_states(s, x, count)); }

EXPORT Status fmi2GetDerivatives(void *c, double dx[], size_t count)
{
    ENTER(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED);
    const char *wrong = count == (size_t)s->model.n ? refresh(s) : "the number of states is another";
    if (!wrong) rates(s, s->x, s->u, dx);
    RETURN(wrong);
}

EXPORT Status fmi2GetEventIndicators(void *c, double indicators[], size_t count)
{
    ENTER(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED);
    (void)indicators;
    RETURN(count ? "there are no event indicators" : NULL);
}

EXPORT Status fmi2GetContinuousStates(void *c, double x[], size_t count)
{
    ENTER(INITIALIZATION | EVENT | CONTINUOUS | TERMINATED);
    if (count != (size_t)s->model.n) RETURN("the number of states is another");
    memcpy(x, s->x, count * sizeof(double));
    return OK;
}

EXPORT Status fmi2GetNominalsOfContinuousStates(void *c, double x[], size_t count)
{
    ENTER(ANY);
    if (count != (size_t)s->model.n) RETURN("the number of states is another");
    memcpy(x, s->model.nominal, count * sizeof(double));
    return OK;
}

/* Co-simulation */
EXPORT Status fmi2SetRealInputDerivatives(void *c, const unsigned vr[], size_t count, const int order[], const double v[])
{
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    int64_t k;
    for (size_t i = 0; i < count; i++) {
        if (known(s, vr[i], &k) != INPUT) RETURN("only inputs have derivatives");
        if (order[i] != 1 || !isfinite(v[i])) RETURN("only finite first derivatives of inputs can be set");
    }
    /* a slope holds for one step; what was set for the last one stays only for the derivatives of outputs */
    if (!s->slope_set) memset(s->slope, 0, (size_t)s->model.m * sizeof(double));
    for (size_t i = 0; i < count; i++) { known(s, vr[i], &k); s->slope[k] = v[i]; }
    s->slope_set = 1;
    return OK;
}

EXPORT Status fmi2GetRealOutputDerivatives(void *c, const unsigned vr[], size_t count, const int order[], double v[])
{
    ENTER(STEP | TERMINATED);
    RETURN(output_slopes(s, vr, order, count, v));
}

EXPORT Status fmi2DoStep(void *c, double t, double h, int final)
{
    ENTER(STEP);
    (void)final;
    if (!isfinite(t) || !(h >= 0) || !isfinite(h)) RETURN("the step is negative or not finite");
    s->t = t;
    if (h == 0) return OK;
    const char *wrong = advance(s, h, s->slope_set);
    if (!wrong) {
        if (!s->slope_set) memset(s->slope, 0, (size_t)s->model.m * sizeof(double));
        s->slope_set = 0;
        s->t = t + h;
    }
    RETURN(wrong);
}

EXPORT Status fmi2CancelStep(void *c) { ENTER(0); return OK; }

static Status status_of(void *c, const char *function)
{
    return allowed(c, STEP | TERMINATED, function) ? DISCARD : FAULT;
}

EXPORT Status fmi2GetStatus(void *c, const StatusKind kind, Status *v) { (void)kind; (void)v; return status_of(c, __func__); }

EXPORT Status fmi2GetRealStatus(void *c, const StatusKind kind, double *v)
{
    Status status = status_of(c, __func__);
    if (status != DISCARD || kind != 2) return status;     /* the last successful time */
    ANSWER(v, ((Instance *)c)->t);
    return OK;
}

EXPORT Status fmi2GetIntegerStatus(void *c, const StatusKind kind, int *v) { (void)kind; (void)v; return status_of(c, __func__); }

EXPORT Status fmi2GetBooleanStatus(void *c, const StatusKind kind, int *v)
{
    Status status = status_of(c, __func__);
    if (status != DISCARD || kind != 3) return status;     /* whether the system ended the simulation, which it never does */
    ANSWER(v, 0);
    return OK;
}

EXPORT Status fmi2GetStringStatus(void *c, const StatusKind kind, const char **v) { (void)kind; (void)v; return status_of(c, __func__); }
