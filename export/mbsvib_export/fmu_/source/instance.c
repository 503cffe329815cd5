/* Instances: memory, the order of calls, variables by their references, derivatives by references. */
#include "lti.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int hexadecimal(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* FMI 2 hands over file:///a/b%20c, FMI 3 a path */
static const char *path_of(const char *uri, char *path, size_t room)
{
    size_t k = 0;
    if (strncmp(uri, "file:", 5)) {
        if (strlen(uri) >= room) return NULL;
        return strcpy(path, uri);
    }
    uri += 5;
    if (!strncmp(uri, "//", 2)) {      /* an authority, which is this machine */
        uri = strchr(uri + 2, '/');
        if (!uri) return NULL;
    }
#ifdef _WIN32
    if (uri[0] == '/' && uri[1] && (uri[2] == ':' || uri[2] == '|')) uri++;
#endif
    for (; *uri; uri++) {
        int high = uri[0] == '%' ? hexadecimal(uri[1]) : -1, low = high >= 0 ? hexadecimal(uri[2]) : -1;
        if (k + 1 >= room) return NULL;
        path[k++] = low >= 0 ? (char)(high * 16 + low) : uri[0];
        if (low >= 0) uri += 2;
    }
    path[k] = 0;
    return path;
}

void instance_free(Instance *s)
{
    if (!s) return;
    for (int i = 0; i < KEPT_STEPS; i++) free(s->kept[i].phi);
    free(s->present);
    free(s->lu);
    free(s->pivot);
    free(s->x);
    model_free(&s->model);
    free(s);
}

static int allocate(Instance *s)
{
    const Model *model = &s->model;
    size_t n = (size_t)model->n, m = (size_t)model->m, p = (size_t)model->p, np = (size_t)model->np;
    int descriptor = model->iF > model->iE;
    double *matrices = model->base;
    s->x = calloc(5 * n + 4 * m + p + 2 * np + 1, sizeof(double));
    if (!s->x) return -1;
    s->u = s->x + n; s->slope = s->u + m; s->par = s->slope + m; s->wx = s->par + np; s->wr = s->wx + n; s->wy = s->wr + n;
    s->wu = s->wy + p; s->tx = s->wu + m; s->tu = s->tx + n; s->tp = s->tu + m;
    if (np || descriptor) {
        matrices = s->present = malloc((size_t)(model->total + 1) * sizeof(double));
        if (!s->present) return -1;
    }
    if (descriptor) {
        s->lu = malloc((n * n + 1) * sizeof(double));
        s->pivot = malloc((n + 1) * sizeof(int64_t));
        if (!s->lu || !s->pivot) return -1;
    }
    s->A = matrices; s->B = matrices + model->iB; s->C = matrices + model->iC; s->D = matrices + model->iD;
    return 0;
}

Instance *instance_new(const char *folder, const char *token, const char *name, const char **wrong)
{
    char path[4096];
    Instance *s = calloc(1, sizeof *s);
    *wrong = !s ? "memory is short" : !folder || !path_of(folder, path, sizeof path) ? "the importer gave no folder" : NULL;
    if (!*wrong) *wrong = model_load(&s->model, path);
    if (!*wrong && (!token || strcmp(token, s->model.token))) *wrong = "it belongs to another modelDescription.xml";
    if (!*wrong && allocate(s)) *wrong = "memory is short";
    if (*wrong) { instance_free(s); return NULL; }
    snprintf(s->name, sizeof s->name, "%s", name ? name : "");
    instance_reset(s);
    return s;
}

void instance_reset(Instance *s)
{
    const Model *model = &s->model;
    s->t = 0;
    s->mode = INSTANTIATED;
    s->slope_set = 0;
    memcpy(s->x, model->x0, (size_t)model->n * sizeof(double));
    memcpy(s->u, model->u0, (size_t)model->m * sizeof(double));
    memcpy(s->par, model->p0, (size_t)model->np * sizeof(double));
    memset(s->slope, 0, (size_t)model->m * sizeof(double));
    s->dirty = 1;
}

/* -1, having said why */
int fail(Instance *s, const char *function, const char *wrong)
{
    char text[512];
    snprintf(text, sizeof text, "%s: %s", function, wrong);
    if (s->logger) s->logger(s, text);
    return -1;
}

static const char *mode_name(int mode)
{
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZATION: return "initialization mode";
    case EVENT: return "event mode";
    case CONTINUOUS: return "continuous-time mode";
    case STEP: return "step mode";
    case UPDATE: return "intermediate update mode";
    default: return "terminated";
    }
}

/* whether the standards allow a call in the present mode; says so where not */
int allowed(Instance *s, int modes, const char *function)
{
    char text[160];
    if (!s) return 0;
    if (s->mode & modes) return 1;
    snprintf(text, sizeof text, "not allowed in this order of calls: the instance is in the state '%s'", mode_name(s->mode));
    fail(s, function, text);
    return 0;
}

/* group of a reference, and its place in the group */
int known(const Instance *s, uint32_t reference, int64_t *index)
{
    const Model *model = &s->model;
    const int64_t length[] = {1, model->m, model->p, model->n, model->n, model->np};
    int64_t left = reference;
    for (int group = TIME; group < UNKNOWN; group++) {
        *index = left;
        if (left < length[group]) return group;
        left -= length[group];
    }
    return UNKNOWN;
}

const char *get_values(Instance *s, const uint32_t *references, size_t count, double *values)
{
    int rated = 0;
    const char *wrong = count ? refresh(s) : NULL;
    for (size_t i = 0; i < count && !wrong; i++) {
        int64_t k;
        switch (known(s, references[i], &k)) {
        case TIME: values[i] = s->t; break;
        case INPUT: values[i] = s->u[k]; break;
        case OUTPUT: values[i] = output(s, k, s->x, s->u); break;
        case STATE: values[i] = s->x[k]; break;
        case RATE:
            if (!rated) rates(s, s->x, s->u, s->wr);
            rated = 1;
            values[i] = s->wr[k];
            break;
        case PARAMETER: values[i] = s->par[k]; break;
        default: wrong = "there is no variable with this value reference";
        }
    }
    return wrong;
}

const char *set_values(Instance *s, const uint32_t *references, size_t count, const double *values)
{
    for (size_t i = 0; i < count; i++) {          /* all or none */
        int64_t k;
        int group = known(s, references[i], &k);
        if (group == UNKNOWN) return "there is no variable with this value reference";
        if (group != INPUT && group != STATE && group != PARAMETER) return "time, outputs and derivatives cannot be set";
        if (group == PARAMETER && s->mode & UPDATE) return "parameters cannot be set within a step";
        if (!isfinite(values[i])) return "a value is not finite";
    }
    for (size_t i = 0; i < count; i++) {
        int64_t k;
        int group = known(s, references[i], &k);
        if (group == PARAMETER && s->par[k] != values[i]) s->dirty = 1;
        (group == INPUT ? s->u : group == STATE ? s->x : s->par)[k] = values[i];
    }
    return NULL;
}

const char *set_states(Instance *s, const double *x, size_t count)
{
    if (count != (size_t)s->model.n) return "the number of states is another";
    for (size_t i = 0; i < count; i++) if (!isfinite(x[i])) return "a state is not finite";
    memcpy(s->x, x, count * sizeof(double));
    return NULL;
}

/* y' = C x' + D u' */
const char *output_slopes(Instance *s, const uint32_t *references, const int32_t *orders, size_t count, double *values)
{
    const char *wrong = refresh(s);
    if (!wrong) rates(s, s->x, s->u, s->wr);
    for (size_t i = 0; i < count && !wrong; i++) {
        int64_t k;
        if (known(s, references[i], &k) != OUTPUT) return "only outputs have derivatives";
        if (orders[i] != 1) return "only first derivatives are known";
        values[i] = output(s, k, s->wr, s->slope);
    }
    return wrong;
}

const char *directional(Instance *s, const uint32_t *unknowns, size_t nu, const uint32_t *knowns, size_t nk,
                        const double *seed, double *result)
{
    const Model *model = &s->model;
    int64_t k;
    memset(s->tx, 0, (size_t)(model->n + model->m + model->np) * sizeof(double));
    for (size_t i = 0; i < nk; i++) switch (known(s, knowns[i], &k)) {
        case INPUT: s->tu[k] += seed[i]; break;
        case STATE: s->tx[k] += seed[i]; break;
        case PARAMETER: s->tp[k] += seed[i]; break;
        case TIME: break;
        default: return "derivatives are taken with respect to inputs, states and parameters";
    }
    const char *wrong = forward(s, s->wr, s->wy);
    for (size_t i = 0; i < nu && !wrong; i++) switch (known(s, unknowns[i], &k)) {
        case OUTPUT: result[i] = s->wy[k]; break;
        case RATE: result[i] = s->wr[k]; break;
        default: wrong = "derivatives are taken of outputs and of derivatives of states";
    }
    return wrong;
}

const char *adjoint(Instance *s, const uint32_t *unknowns, size_t nu, const uint32_t *knowns, size_t nk,
                    const double *seed, double *result)
{
    const Model *model = &s->model;
    int64_t k;
    memset(s->wr, 0, (size_t)(model->n + model->p) * sizeof(double));
    for (size_t i = 0; i < nu; i++) switch (known(s, unknowns[i], &k)) {
        case OUTPUT: s->wy[k] += seed[i]; break;
        case RATE: s->wr[k] += seed[i]; break;
        default: return "derivatives are taken of outputs and of derivatives of states";
    }
    const char *wrong = backward(s, s->wr, s->wy);
    for (size_t i = 0; i < nk && !wrong; i++) switch (known(s, knowns[i], &k)) {
        case INPUT: result[i] = s->tu[k]; break;
        case STATE: result[i] = s->tx[k]; break;
        case PARAMETER: result[i] = s->tp[k]; break;
        case TIME: result[i] = 0; break;
        default: wrong = "derivatives are taken with respect to inputs, states and parameters";
    }
    return wrong;
}
