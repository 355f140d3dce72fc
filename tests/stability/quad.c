#include "tests/stability/quad.h"

#include <math.h>

// pi as a sum of doubles (each the rest rounded): 3 times 53 bits.
quad quad_pi(void) { return (quad)0x1.921fb54442d18p+1 + (quad)0x1.1a62633145c07p-53 + (quad)-0x1.f1976b7ed8fbcp-109; }

quad quad_abs(quad x) { return x < 0 ? -x : x; }

quad quad_sqrt(quad x)
{
    if (!(x > 0))
        return x == 0 ? x : (quad)NAN;
    if (x > (quad)1e300 * 1e300) // inf, too: no Newton step converges from a double's range
        return x - x == 0 ? quad_sqrt(x * (quad)0x1p-1000) * (quad)0x1p500 : x;
    if (x < (quad)1e-300)
        return quad_sqrt(x * (quad)0x1p1000) * (quad)0x1p-500;
    if (x > (quad)1e300)
        return quad_sqrt(x * (quad)0x1p-1000) * (quad)0x1p500;
    quad y = (quad)sqrt((double)x);
    for (int i = 0; i < 3; i++) // Newton: 53 bits, 106, all
        y = (y + x / y) / 2;
    return y;
}

// Of |x| <= pi / 4.
static quad sine_series(quad x)
{
    quad term = x, sum = x;
    for (int k = 1; k < 20; k++) {
        term *= -x * x / (quad)(2 * k * (2 * k + 1));
        sum += term;
    }
    return sum;
}

static quad cosine_series(quad x)
{
    quad term = 1, sum = 1;
    for (int k = 1; k < 20; k++) {
        term *= -x * x / (quad)(2 * k * (2 * k - 1));
        sum += term;
    }
    return sum;
}

// sin(x + quarters pi / 2)
static quad sine_of(quad x, int quarters)
{
    const quad half_pi = quad_pi() / 2;
    if (!(quad_abs(x) < (quad)1e9))
        return (quad)NAN;
    const double k = floor((double)(x / half_pi) + 0.5);
    // pi / 2 a second time from its parts: the first product is exact
    const quad r = (x - (quad)k * (quad)0x1.921fb54442d18p+0) -
                   (quad)k * ((quad)0x1.1a62633145c07p-54 + (quad)-0x1.f1976b7ed8fbcp-110);
    const int q = (int)(((long long)k % 4 + 4 + quarters) % 4);
    const quad value = q % 2 ? cosine_series(r) : sine_series(r);
    return q < 2 ? value : -value;
}

quad quad_sin(quad x) { return sine_of(x, 0); }
quad quad_cos(quad x) { return sine_of(x, 1); }

// Newton on sin and cos of the angle: each step triples the digits of a double's.
quad quad_atan2(quad y, quad x)
{
    if (x == 0 && y == 0)
        return 0;
    const quad scale = quad_abs(x) > quad_abs(y) ? quad_abs(x) : quad_abs(y);
    x /= scale;
    y /= scale;
    const quad length = quad_sqrt(x * x + y * y);
    quad a = (quad)atan2((double)y, (double)x);
    for (int i = 0; i < 3; i++) {
        const quad s = quad_sin(a), c = quad_cos(a);
        a += (y * c - x * s) / length; // sine of the error
    }
    return a;
}

quad quad_acos(quad x) { return x >= -1 && x <= 1 ? quad_atan2(quad_sqrt((1 - x) * (1 + x)), x) : (quad)NAN; }

quad quad_asin(quad x) { return x >= -1 && x <= 1 ? quad_atan2(x, quad_sqrt((1 - x) * (1 + x))) : (quad)NAN; }

// exp(x) = exp(x / 2^n)^(2^n)
quad quad_exp(quad x)
{
    int halvings = 0;
    for (; quad_abs(x) > (quad)0.01 && halvings < 40; halvings++)
        x /= 2;
    quad term = x, sum = x; // of exp(x) - 1, so that squaring loses nothing
    for (int k = 2; k < 20; k++) {
        term *= x / (quad)k;
        sum += term;
    }
    for (int i = 0; i < halvings; i++)
        sum = sum * (2 + sum);
    return 1 + sum;
}

// Newton (Halley) on the exponential.
quad quad_log(quad x)
{
    if (!(x > 0))
        return x == 0 ? (quad)-INFINITY : (quad)NAN;
    const quad scaled = x < (quad)1e-300 ? x * (quad)0x1p1000 : x;
    quad y = (quad)log((double)scaled);
    for (int i = 0; i < 3; i++) {
        const quad e = quad_exp(y);
        y += 2 * (scaled - e) / (scaled + e);
    }
    const quad ln2 = (quad)0x1.62e42fefa39efp-1 + (quad)0x1.abc9e3b39803fp-56 + (quad)0x1.7b57a079a1934p-111;
    return x < (quad)1e-300 ? y - 1000 * ln2 : y;
}
