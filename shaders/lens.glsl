// Brown-Conrady lens distortion, as base/lens.c. coefficients: (k1, k2, p1, p2).
float radial_factor(float r2, vec4 coefficients, float k3)
{
    return 1.0 + r2 * (coefficients.x + r2 * (coefficients.y + r2 * k3));
}

// The ideal image point q (x / z, y / z), distorted. r2: its squared radius.
vec2 distort_point(vec2 q, float r2, vec4 coefficients, float k3)
{
    float radial = radial_factor(r2, coefficients, k3);
    vec2 tangential = vec2(2.0 * coefficients.z * q.x * q.y + coefficients.w * (r2 + 2.0 * q.x * q.x),
                           coefficients.z * (r2 + 2.0 * q.y * q.y) + 2.0 * coefficients.w * q.x * q.y);
    return q * radial + tangential;
}

// For vertices: the distorted image point of p (camera axes), times z. Beyond the image's corners (largest_r2) the
// polynomial may fold back, so the radial factor is held there; in front of and behind the camera plane the map stays
// linear, so that clipping is correct.
vec2 distort_vertex(vec3 p, vec4 coefficients, float k3, float largest_r2)
{
    vec2 q = p.xy / max(p.z, 1e-4);
    float r2 = dot(q, q);
    if (p.z < 1e-4 || r2 > largest_r2)
        return p.xy * radial_factor(largest_r2, coefficients, k3);
    return distort_point(q, r2, coefficients, k3) * p.z;
}
