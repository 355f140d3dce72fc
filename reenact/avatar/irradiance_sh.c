#include "reenact/avatar/irradiance_sh.h"

#include <math.h>

void sh_basis(const float n[3], float y[SH_TERMS])
{
    y[0] = 1;
    y[1] = n[0], y[2] = n[1], y[3] = n[2];
    y[4] = n[0] * n[1], y[5] = n[1] * n[2], y[6] = n[0] * n[2];
    y[7] = n[0] * n[0] - n[1] * n[1], y[8] = 3 * n[2] * n[2] - 1;
}

float sh_irradiance_at(const struct sh_irradiance *irradiance, const float n[3])
{
    float y[SH_TERMS], sum = 0;
    sh_basis(n, y);
    for (int i = 0; i < SH_TERMS; i++)
        sum += irradiance->term[i] * y[i];
    return fminf(fmaxf(sum, IRRADIANCE_MIN), IRRADIANCE_MAX);
}
