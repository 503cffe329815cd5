/* Exact steps: x(t + h) = phi x + g0 u + g1 u' for inputs that are constant or linear in time. */
#include "lti.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static double largest_column(int64_t n, const double *a)
{
    double best = 0;
    for (int64_t j = 0; j < n; j++) {
        double sum = 0;
        for (int64_t i = 0; i < n; i++) sum += fabs(a[i * n + j]);
        if (!(sum <= best)) best = sum;
    }
    return best;
}

static void combine(size_t count, double *sum, const double *a, double fa, const double *b, double fb, const double *c,
                    double fc)
{
    for (size_t i = 0; i < count; i++) sum[i] = fa * a[i] + fb * b[i] + fc * c[i];
}

static void add(size_t count, double *sum, const double *a, double fa, const double *b, double fb, const double *c,
                double fc, int64_t n, double diagonal)
{
    for (size_t i = 0; i < count; i++) sum[i] += fa * a[i] + fb * b[i] + fc * c[i];
    for (int64_t i = 0; i < n; i++) sum[i * n + i] += diagonal;
}

/* e = exp(a), Pade approximant of order 13 with scaling and squaring (Higham, SIAM J. Matrix Anal. 26, 2005); a is lost */
static int exponential(int64_t n, double *a, double *e)
{
    static const double b[] = {64764752532480000., 32382376266240000., 7771770303897600., 1187353796428800.,
        129060195264000., 10559470521600., 670442572800., 33522128640., 1323241920., 40840800., 960960., 16380., 182., 1.};
    size_t count = (size_t)(n * n);
    int halvings = 0, wrong;
    double size = largest_column(n, a);
    if (!isfinite(size)) return -1;
    while (size > 5.371920351148152) { size *= 0.5; halvings++; }
    double scale = ldexp(1.0, -halvings);
    double *work = malloc(6 * count * sizeof(double) + (size_t)n * sizeof(int64_t));
    if (!work) return -1;
    double *a2 = work, *a4 = a2 + count, *a6 = a4 + count, *w = a6 + count, *odd = w + count, *even = odd + count;
    int64_t *pivot = (int64_t *)(even + count);
    for (size_t i = 0; i < count; i++) a[i] *= scale;
    product(n, a, a, a2); product(n, a2, a2, a4); product(n, a2, a4, a6);
    combine(count, w, a6, b[13], a4, b[11], a2, b[9]);
    product(n, a6, w, even);
    add(count, even, a6, b[7], a4, b[5], a2, b[3], n, b[1]);
    product(n, a, even, odd);
    combine(count, w, a6, b[12], a4, b[10], a2, b[8]);
    product(n, a6, w, even);
    add(count, even, a6, b[6], a4, b[4], a2, b[2], n, b[0]);
    for (size_t i = 0; i < count; i++) { e[i] = even[i] + odd[i]; w[i] = even[i] - odd[i]; }
    wrong = factorise(n, w, pivot);
    if (!wrong) divide(n, w, pivot, n, e);
    for (; halvings > 0 && !wrong; halvings--) { product(n, e, e, w); memcpy(e, w, count * sizeof(double)); }
    free(work);
    return wrong;
}

/* a <- s^-1 a s with powers of two in s (Parlett and Reinsch): states of unlike units lose no digits */
static void balance(int64_t n, double *a, double *s)
{
    int again = 60;
    for (int64_t i = 0; i < n; i++) s[i] = 1.0;
    while (again--) {
        int changed = 0;
        for (int64_t i = 0; i < n; i++) {
            double column = 0, row = 0, f = 1;
            for (int64_t j = 0; j < n; j++) if (j != i) { column += fabs(a[j * n + i]); row += fabs(a[i * n + j]); }
            if (column == 0 || row == 0) continue;
            while (column * f * f < row / 2 && f < 1e150) f *= 2;
            while (column * f * f > row * 2 && f > 1e-150) f /= 2;
            if (column * f + row / f < 0.95 * (column + row)) {
                changed = 1;
                s[i] *= f;
                for (int64_t j = 0; j < n; j++) a[j * n + i] *= f;
                for (int64_t j = 0; j < n; j++) a[i * n + j] /= f;
            }
        }
        if (!changed) break;
    }
}

/* One diagonal block: exp [[a, b, 0], [0, 0, 1], [0, 0, 0]] h holds phi, g0 and g1 / h in its first rows
 * (Van Loan, IEEE Trans. Automat. Control 23, 1978). b is scaled by a power of two to the size of a.  */
int hold_block(int64_t n, int64_t m, const double *a, const double *b, double h, double *phi, double *g0, double *g1)
{
    int whole = m > n;                 /* more inputs than states: integrate the identity instead of b */
    int64_t k = whole ? n : m, size = n + 2 * k;
    double *z = calloc((size_t)(2 * size * size + n * n + n), sizeof(double)), beta = 1.0, largest = 0;
    if (!z) return -1;
    double *e = z + size * size, *scaled = e + size * size, *s = scaled + n * n;
    memcpy(scaled, a, (size_t)(n * n) * sizeof(double));
    balance(n, scaled, s);
    for (int64_t i = 0; i < n * n; i++) scaled[i] *= h;
    double norm = largest_column(n, scaled);
    for (int64_t i = 0; i < n; i++) {
        memcpy(z + i * size, scaled + i * n, (size_t)n * sizeof(double));
        for (int64_t j = 0; j < k; j++) z[i * size + n + j] = h * (whole ? (double)(i == j) : b[i * m + j]) / s[i];
    }
    for (int64_t j = 0; j < k; j++) {
        double sum = 0;
        for (int64_t i = 0; i < n; i++) sum += fabs(z[i * size + n + j]);
        if (sum > largest) largest = sum;
    }
    if (largest > 0 && isfinite(largest)) {
        int power;
        frexp(largest / (norm > 1 ? norm : 1), &power);
        beta = ldexp(1.0, power);
    }
    for (int64_t i = 0; i < n; i++) for (int64_t j = 0; j < k; j++) z[i * size + n + j] /= beta;
    for (int64_t j = 0; j < k; j++) z[(n + j) * size + n + k + j] = 1.0;
    int wrong = exponential(size, z, e);
    for (int64_t i = 0; i < n && !wrong; i++) {
        const double *row = e + i * size;
        for (int64_t j = 0; j < n; j++) phi[i * n + j] = row[j] * s[i] / s[j];
        for (int64_t j = 0; j < m; j++) {
            double once = 0, twice = 0;
            if (whole) for (int64_t q = 0; q < n; q++) { once += row[n + q] * b[q * m + j]; twice += row[2 * n + q] * b[q * m + j]; }
            else { once = row[n + j]; twice = row[n + k + j]; }
            g0[i * m + j] = once * s[i] * beta;
            g1[i * m + j] = twice * s[i] * beta * h;
        }
    }
    free(z);
    return wrong;
}
