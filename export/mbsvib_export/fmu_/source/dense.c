/* Dense matrices, row by row. */
#include "lti.h"
#include <math.h>
#include <string.h>

/* c = a b, four rows at a time so that each row of b is read once for them */
void product(int64_t n, const double *a, const double *b, double *c)
{
    int64_t i = 0;
    memset(c, 0, (size_t)(n * n) * sizeof(double));
    for (; i + 4 <= n; i += 4) {
        const double *a0 = a + i * n, *a1 = a0 + n, *a2 = a1 + n, *a3 = a2 + n;
        double *restrict c0 = c + i * n, *restrict c1 = c0 + n, *restrict c2 = c1 + n, *restrict c3 = c2 + n;
        for (int64_t k = 0; k < n; k++) {
            const double *row = b + k * n;
            double f0 = a0[k], f1 = a1[k], f2 = a2[k], f3 = a3[k];
            if (f0 == 0 && f1 == 0 && f2 == 0 && f3 == 0) continue;
            for (int64_t j = 0; j < n; j++) {
                double v = row[j];
                c0[j] += f0 * v; c1[j] += f1 * v; c2[j] += f2 * v; c3[j] += f3 * v;
            }
        }
    }
    for (; i < n; i++)
        for (int64_t k = 0; k < n; k++) {
            double f = a[i * n + k];
            if (f == 0) continue;
            for (int64_t j = 0; j < n; j++) c[i * n + j] += f * b[k * n + j];
        }
}

static void swap_rows(int64_t columns, double *one, double *other)
{
    for (int64_t j = 0; j < columns; j++) { double v = one[j]; one[j] = other[j]; other[j] = v; }
}

/* a = P L U in place; -1 if a is singular or not finite */
int factorise(int64_t n, double *a, int64_t *pivot)
{
    for (int64_t c = 0; c < n; c++) {
        int64_t best = c;
        for (int64_t i = c + 1; i < n; i++) if (fabs(a[i * n + c]) > fabs(a[best * n + c])) best = i;
        double largest = a[best * n + c];
        if (largest == 0 || !isfinite(largest)) return -1;
        pivot[c] = best;
        if (best != c) swap_rows(n, a + c * n, a + best * n);
        for (int64_t i = c + 1; i < n; i++) {
            double f = a[i * n + c] / largest;
            a[i * n + c] = f;
            if (f != 0) for (int64_t j = c + 1; j < n; j++) a[i * n + j] -= f * a[c * n + j];
        }
    }
    return 0;
}

/* x = a^-1 x */
void divide(int64_t n, const double *lu, const int64_t *pivot, int64_t columns, double *x)
{
    for (int64_t c = 0; c < n; c++)
        if (pivot[c] != c) swap_rows(columns, x + c * columns, x + pivot[c] * columns);
    for (int64_t i = 1; i < n; i++)
        for (int64_t k = 0; k < i; k++) {
            double f = lu[i * n + k];
            if (f != 0) for (int64_t j = 0; j < columns; j++) x[i * columns + j] -= f * x[k * columns + j];
        }
    for (int64_t i = n - 1; i >= 0; i--) {
        for (int64_t k = i + 1; k < n; k++) {
            double f = lu[i * n + k];
            if (f != 0) for (int64_t j = 0; j < columns; j++) x[i * columns + j] -= f * x[k * columns + j];
        }
        for (int64_t j = 0; j < columns; j++) x[i * columns + j] /= lu[i * n + i];
    }
}
