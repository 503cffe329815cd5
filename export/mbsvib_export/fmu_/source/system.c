/* The equations for the present parameters: rates, outputs, exact steps and derivatives. */
#include "lti.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ROUNDING 1e-14    /* of entries that are sums: what is left of a pivot below this share of them is noise */

/* E = P L U; -1 if rounding alone keeps it from being singular, as where the mass that is taken away is all there is */
static int factorise_mass(Instance *s)
{
    const Model *model = &s->model;
    int64_t n = model->n;
    double *size = s->wx;              /* of the summands in each column of E */
    memset(size, 0, (size_t)n * sizeof(double));
    for (int64_t i = 0; i < n * n; i++) size[i % n] = fmax(size[i % n], fabs(model->base[model->iE + i]));
    for (int64_t k = 0; k < model->np; k++)
        for (int64_t i = model->first[k]; i < model->first[k + 1]; i++) {
            int64_t place = model->at[i] - model->iE, column = place % n;
            double change = fabs((s->par[k] - model->p0[k]) * model->slope[i]);
            if (place >= 0 && place < n * n) size[column] = fmax(size[column], change);
        }
    memcpy(s->lu, s->present + model->iE, (size_t)(n * n) * sizeof(double));
    if (factorise(n, s->lu, s->pivot)) return -1;
    for (int64_t c = 0; c < n; c++) if (fabs(s->lu[c * n + c]) <= ROUNDING * size[c]) return -1;
    return 0;
}

/* A, B, C, D of the present parameters: E^-1 A, E^-1 B, C + F E^-1 A, D + F E^-1 B */
const char *refresh(Instance *s)
{
    const Model *model = &s->model;
    int64_t n = model->n, m = model->m, p = model->p;
    if (!s->dirty) return NULL;
    if (s->present) {
        double *now = s->present;
        memcpy(now, model->base, (size_t)model->total * sizeof(double));
        for (int64_t k = 0; k < model->np; k++) {
            double change = s->par[k] - model->p0[k];
            if (change != 0)
                for (int64_t i = model->first[k]; i < model->first[k + 1]; i++) now[model->at[i]] += change * model->slope[i];
        }
        if (model->iF > model->iE) {
            if (factorise_mass(s)) return "the parameters make the mass matrix singular";
            divide(n, s->lu, s->pivot, n, s->A);
            divide(n, s->lu, s->pivot, m, s->B);
            for (int64_t i = 0; i < p; i++)
                for (int64_t k = 0; k < n; k++) {
                    double f = now[model->iF + i * n + k];
                    if (f == 0) continue;
                    for (int64_t j = 0; j < n; j++) s->C[i * n + j] += f * s->A[k * n + j];
                    for (int64_t j = 0; j < m; j++) s->D[i * m + j] += f * s->B[k * m + j];
                }
        }
        for (int64_t i = 0; i < model->iE; i++) if (!isfinite(now[i])) return "the parameters make the equations overflow";
    }
    for (int i = 0; i < KEPT_STEPS; i++) s->kept[i].h = -1;
    s->dirty = 0;
    return NULL;
}

void rates(const Instance *s, const double *x, const double *u, double *dx)
{
    const Model *model = &s->model;
    int64_t m = model->m;
    for (int64_t k = 0; k < model->blocks; k++) {
        int64_t o = model->offset[k], rows = model->offset[k + 1] - o;
        const double *a = s->A + model->start[k];
        for (int64_t i = 0; i < rows; i++) {
            double sum = 0;
            for (int64_t j = 0; j < rows; j++) sum += a[i * rows + j] * x[o + j];
            for (int64_t j = 0; j < m; j++) sum += s->B[(o + i) * m + j] * u[j];
            dx[o + i] = sum;
        }
    }
}

double output(const Instance *s, int64_t row, const double *x, const double *u)
{
    int64_t n = s->model.n, m = s->model.m;
    double sum = 0;
    for (int64_t j = 0; j < n; j++) sum += s->C[row * n + j] * x[j];
    for (int64_t j = 0; j < m; j++) sum += s->D[row * m + j] * u[j];
    return sum;
}

static Exponential *step_of(Instance *s, double h)
{
    const Model *model = &s->model;
    int64_t n = model->n, m = model->m, na = model->iB;
    Exponential *oldest = s->kept;
    /* importers compute steps as differences of times, and mean the same step by what rounding leaves */
    double same = 1e-13 * h + 4 * 2.3e-16 * fabs(s->t);
    s->tick++;
    for (int i = 0; i < KEPT_STEPS; i++) {
        Exponential *e = s->kept + i;
        if (e->phi && e->h > 0 && fabs(e->h - h) <= same) { e->used = s->tick; return e; }
        if (e->used < oldest->used) oldest = e;
    }
    if (!oldest->phi) {
        oldest->phi = malloc((size_t)(na + 2 * n * m + 1) * sizeof(double));
        if (!oldest->phi) return NULL;
        oldest->g0 = oldest->phi + na;
        oldest->g1 = oldest->g0 + n * m;
    }
    oldest->h = -1;
    for (int64_t k = 0; k < model->blocks; k++) {
        int64_t o = model->offset[k], rows = model->offset[k + 1] - o;
        if (hold_block(rows, m, s->A + model->start[k], s->B + o * m, h, oldest->phi + model->start[k], oldest->g0 + o * m,
                       oldest->g1 + o * m)) return NULL;
    }
    oldest->h = h;
    oldest->used = s->tick;
    s->computed++;
    return oldest;
}

/* x and u to the end of a step in which u is held, or runs with its slope */
const char *advance(Instance *s, double h, int sloped)
{
    const Model *model = &s->model;
    int64_t m = model->m;
    const char *wrong = refresh(s);
    if (wrong) return wrong;
    const Exponential *e = step_of(s, h);
    if (!e) return "the exponential of the step overflows, or memory is short";
    for (int64_t k = 0; k < model->blocks; k++) {
        int64_t o = model->offset[k], rows = model->offset[k + 1] - o;
        const double *phi = e->phi + model->start[k];
        for (int64_t i = 0; i < rows; i++) {
            const double *g0 = e->g0 + (o + i) * m, *g1 = e->g1 + (o + i) * m;
            double sum = 0;
            for (int64_t j = 0; j < rows; j++) sum += phi[i * rows + j] * s->x[o + j];
            for (int64_t j = 0; j < m; j++) sum += g0[j] * s->u[j];
            if (sloped) for (int64_t j = 0; j < m; j++) sum += g1[j] * s->slope[j];
            if (!isfinite(sum)) return "the states grow beyond all numbers within the step";
            s->wx[o + i] = sum;
        }
    }
    memcpy(s->x, s->wx, (size_t)model->n * sizeof(double));
    if (sloped) for (int64_t j = 0; j < m; j++) s->u[j] += h * s->slope[j];
    return NULL;
}

/* derivatives of x' and y to parameter k: E dx = dA x + dB u - dE x',  dy = dC x + dD u + dF x' + F dx */
static void parameter_rates(Instance *s, int64_t k, const double *rate, double *dx, double *dy)
{
    const Model *model = &s->model;
    int64_t n = model->n, m = model->m, p = model->p, cut[] = {0, model->iB, model->iC, model->iD, model->iE, model->iF};
    memset(dx, 0, (size_t)n * sizeof(double));
    memset(dy, 0, (size_t)p * sizeof(double));
    for (int64_t i = model->first[k]; i < model->first[k + 1]; i++) {
        int which = 5;
        while (model->at[i] < cut[which]) which--;
        int64_t columns = which == 1 || which == 3 ? m : n, place = model->at[i] - cut[which];
        int64_t row = place / columns, column = place % columns;
        const double *v = which == 1 || which == 3 ? s->u : which < 4 ? s->x : rate;
        double term = model->slope[i] * v[column];
        if (which < 2) dx[row] += term;
        else if (which == 4) dx[row] -= term;
        else dy[row] += term;
    }
    if (s->lu) {
        divide(n, s->lu, s->pivot, 1, dx);
        for (int64_t i = 0; i < p; i++)
            for (int64_t j = 0; j < n; j++) dy[i] += s->present[model->iF + i * n + j] * dx[j];
    }
}

/* dx, dy along the directions tx, tu, tp */
const char *forward(Instance *s, double *dx, double *dy)
{
    const Model *model = &s->model;
    const char *wrong = refresh(s);
    if (wrong) return wrong;
    rates(s, s->tx, s->tu, dx);
    for (int64_t i = 0; i < model->p; i++) dy[i] = output(s, i, s->tx, s->tu);
    double *rate = NULL;
    for (int64_t k = 0; k < model->np; k++) {
        if (s->tp[k] == 0) continue;
        if (!rate) {
            rate = malloc((size_t)(2 * model->n + model->p + 1) * sizeof(double));
            if (!rate) return "memory is short";
            rates(s, s->x, s->u, rate);
        }
        double *px = rate + model->n, *py = px + model->n;
        parameter_rates(s, k, rate, px, py);
        for (int64_t i = 0; i < model->n; i++) dx[i] += s->tp[k] * px[i];
        for (int64_t i = 0; i < model->p; i++) dy[i] += s->tp[k] * py[i];
    }
    free(rate);
    return NULL;
}

/* tx, tu, tp: gradients of dx . x' + dy . y */
const char *backward(Instance *s, const double *dx, const double *dy)
{
    const Model *model = &s->model;
    int64_t n = model->n, m = model->m;
    const char *wrong = refresh(s);
    if (wrong) return wrong;
    double *rate = malloc((size_t)(2 * n + model->p + 1) * sizeof(double)), *px = rate + n, *py = px + n;
    if (!rate) return "memory is short";
    memset(s->tx, 0, (size_t)n * sizeof(double));
    memset(s->tu, 0, (size_t)m * sizeof(double));
    for (int64_t k = 0; k < model->blocks; k++) {
        int64_t o = model->offset[k], rows = model->offset[k + 1] - o;
        const double *a = s->A + model->start[k];
        for (int64_t i = 0; i < rows; i++) {
            for (int64_t j = 0; j < rows; j++) s->tx[o + j] += a[i * rows + j] * dx[o + i];
            for (int64_t j = 0; j < m; j++) s->tu[j] += s->B[(o + i) * m + j] * dx[o + i];
        }
    }
    for (int64_t i = 0; i < model->p; i++) {
        for (int64_t j = 0; j < n; j++) s->tx[j] += s->C[i * n + j] * dy[i];
        for (int64_t j = 0; j < m; j++) s->tu[j] += s->D[i * m + j] * dy[i];
    }
    rates(s, s->x, s->u, rate);
    for (int64_t k = 0; k < model->np; k++) {
        double sum = 0;
        parameter_rates(s, k, rate, px, py);
        for (int64_t i = 0; i < n; i++) sum += dx[i] * px[i];
        for (int64_t i = 0; i < model->p; i++) sum += dy[i] * py[i];
        s->tp[k] = sum;
    }
    free(rate);
    return NULL;
}
