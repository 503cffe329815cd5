/* A linear system with named scalars behind FMI 2.0 and 3.0: what the files of this folder share.
 *
 *   E x' = A x + B u,   y = C x + F x' + D u        (E = 1, F = 0 unless the file has them)
 *
 * Every matrix is affine in the tunable parameters. The numbers come from resources/model.lti, so that one binary
 * serves every model. Nothing here is global: instances are independent of each other.
 */
#ifndef LTI_H
#define LTI_H

#include <stddef.h>
#include <stdint.h>

#define KEPT_STEPS 8      /* step sizes whose exponentials an instance keeps */

/* Modes of both standards; an instance is in one of them. */
enum { INSTANTIATED = 1, INITIALIZATION = 2, EVENT = 4, CONTINUOUS = 8, STEP = 16, UPDATE = 32, TERMINATED = 64 };

/* Value references are dense and in this order: time, u, y, x, x', parameters. Some importers use them as indices. */
enum { TIME, INPUT, OUTPUT, STATE, RATE, PARAMETER, UNKNOWN };

typedef struct {
    int64_t n, m, p, np;               /* states, inputs, outputs, parameters */
    int64_t blocks, *offset, *start;   /* A is block-diagonal: first row of each block, where it starts in A */
    int64_t iB, iC, iD, iE, iF, total; /* where the matrices start behind A, row by row; iE == iF: no E and F */
    double *base, *x0, *nominal, *u0, *p0;
    int64_t *first, *at;               /* entries of parameter k: first[k] to first[k + 1]; their places in base */
    double *slope;                     /* derivatives of the entries to the parameter */
    void *storage;
    char token[65];
} Model;

typedef struct { double h; double *phi, *g0, *g1; uint64_t used; } Exponential;

typedef struct Instance Instance;
typedef void (*Logger)(Instance *, const char *text);

struct Instance {
    Model model;
    double *A, *B, *C, *D;             /* for the present parameters, E already divided by */
    double *present, *lu; int64_t *pivot;
    double t, *x, *u, *slope, *par;    /* slope: u' of the last step, or of the next if slope_set */
    double *wx, *wr, *wy, *wu, *tx, *tu, *tp;
    int dirty, slope_set;
    uint64_t tick, computed;
    Exponential kept[KEPT_STEPS];
    int mode, cosimulation, event_mode, early_return;
    Logger logger;
    void *environment, *log, *update;  /* the importer's, as the standards hand them over */
    char name[64];
};

/* dense.c */
void product(int64_t n, const double *a, const double *b, double *c);
int factorise(int64_t n, double *a, int64_t *pivot);
void divide(int64_t n, const double *lu, const int64_t *pivot, int64_t columns, double *x);

/* exponential.c */
int hold_block(int64_t n, int64_t m, const double *a, const double *b, double h, double *phi, double *g0, double *g1);

/* model.c: 0 or what is wrong with the file */
const char *model_load(Model *model, const char *folder);
void model_free(Model *model);
uint32_t checksum(const unsigned char *bytes, size_t length);

/* system.c: 0 or what is wrong */
const char *refresh(Instance *s);
void rates(const Instance *s, const double *x, const double *u, double *dx);
double output(const Instance *s, int64_t row, const double *x, const double *u);
const char *advance(Instance *s, double h, int sloped);
const char *forward(Instance *s, double *dx, double *dy);
const char *backward(Instance *s, const double *dx, const double *dy);

/* instance.c */
Instance *instance_new(const char *folder, const char *token, const char *name, const char **wrong);
void instance_free(Instance *s);
void instance_reset(Instance *s);
int allowed(Instance *s, int modes, const char *function);
int fail(Instance *s, const char *function, const char *wrong);
int known(const Instance *s, uint32_t reference, int64_t *index);
const char *get_values(Instance *s, const uint32_t *references, size_t count, double *values);
const char *set_values(Instance *s, const uint32_t *references, size_t count, const double *values);
const char *set_states(Instance *s, const double *x, size_t count);
const char *output_slopes(Instance *s, const uint32_t *references, const int32_t *orders, size_t count, double *values);
const char *directional(Instance *s, const uint32_t *unknowns, size_t nu, const uint32_t *knowns, size_t nk,
                        const double *seed, double *result);
const char *adjoint(Instance *s, const uint32_t *unknowns, size_t nu, const uint32_t *knowns, size_t nk,
                    const double *seed, double *result);
/* snapshot.c: what saving and restoring keeps */
size_t snapshot_size(const Instance *s);
void snapshot_write(const Instance *s, unsigned char *bytes);
const char *snapshot_check(const Instance *s, const unsigned char *bytes, size_t length);
void snapshot_read(Instance *s, const unsigned char *bytes);

#endif
