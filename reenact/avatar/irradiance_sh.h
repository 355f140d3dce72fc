// Irradiance as a function of the surface normal: real spherical harmonics up to the second order (Ramamoorthi and
// Hanrahan 2001: nine coefficients hold more than 98 % of what a convex diffuse surface receives under distant light).
// World axes. Relative: 1 is the mean; multiplied with a linear albedo it gives linear colour. No state; any thread.
#pragma once

enum { SH_TERMS = 9 };

// The series is clamped to this range: it is an extrapolation where no surface ever faced. Chosen by hand.
#define IRRADIANCE_MIN 0.4F
#define IRRADIANCE_MAX 1.6F

struct sh_irradiance {
    float term[SH_TERMS]; // in the order of sh_basis
};

// The basis functions at the unit normal n, without their normalisation constants, which the coefficients absorb:
// 1, x, y, z, xy, yz, xz, x² - y², 3z² - 1.
void sh_basis(const float n[3], float y[SH_TERMS]);

float sh_irradiance_at(const struct sh_irradiance *irradiance, const float n[3]); // n: unit
