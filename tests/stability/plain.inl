// Textbook formulas, as one writes them down first: no series, no clamps, no branches. Included by plain.c once for
// each precision, with REAL and FN(name) defined. `in` and `out` of each are named in its first line.

// rotation vector -> quaternion x, y, z, w
static void FN(exp_map)(const REAL *in, REAL *out)
{
    const REAL angle = FN(root)(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]), s = FN(sine)(angle / 2) / angle;
    for (int i = 0; i < 3; i++)
        out[i] = in[i] * s;
    out[3] = FN(cosine)(angle / 2);
}

// rotation vector -> the same, by way of the quaternion
static void FN(log_map)(const REAL *in, REAL *out)
{
    REAL q[4];
    FN(exp_map)(in, q);
    const REAL angle = 2 * FN(arc_cosine)(q[3]), s = FN(root)(1 - q[3] * q[3]);
    for (int i = 0; i < 3; i++)
        out[i] = q[i] / s * angle;
}

static void FN(rotate)(const REAL q[4], const REAL v[3], REAL out[3])
{
    const REAL t[3] = {2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]),
                       2 * (q[0] * v[1] - q[1] * v[0])};
    out[0] = v[0] + q[3] * t[0] + q[1] * t[2] - q[2] * t[1];
    out[1] = v[1] + q[3] * t[1] + q[2] * t[0] - q[0] * t[2];
    out[2] = v[2] + q[3] * t[2] + q[0] * t[1] - q[1] * t[0];
}

// rotation about z by in[0], and by in[1], with the second quaternion's sign in[2]; share in[3] -> x axis between them
static void FN(slerp)(const REAL *in, REAL *out)
{
    const REAL a[4] = {0, 0, FN(sine)(in[0] / 2), FN(cosine)(in[0] / 2)};
    const REAL b[4] = {0, 0, in[2] * FN(sine)(in[1] / 2), in[2] * FN(cosine)(in[1] / 2)};
    const REAL theta = FN(arc_cosine)(a[2] * b[2] + a[3] * b[3]), x[3] = {1, 0, 0};
    REAL q[4];
    for (int i = 0; i < 4; i++)
        q[i] = (FN(sine)((1 - in[3]) * theta) * a[i] + FN(sine)(in[3] * theta) * b[i]) / FN(sine)(theta);
    FN(rotate)(q, x, out);
}

// directions a, b -> a's unit vector turned by the shortest rotation that takes a to b
static void FN(turn_between)(const REAL *in, REAL *out)
{
    const REAL *a = in, *b = in + 3;
    const REAL cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    const REAL la = FN(root)(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    const REAL lb = FN(root)(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
    const REAL lc = FN(root)(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
    const REAL angle = FN(arc_cosine)((a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (la * lb));
    const REAL s = FN(sine)(angle / 2), unit[3] = {a[0] / la, a[1] / la, a[2] / la};
    const REAL q[4] = {cross[0] / lc * s, cross[1] / lc * s, cross[2] / lc * s, FN(cosine)(angle / 2)};
    FN(rotate)(q, unit, out);
}

// rotation matrix of a unit axis in[0..2] and angle in[3] -> (0.2, -1.3, 2.2) turned by the quaternion taken from it
static void FN(from_matrix)(const REAL *in, REAL *out)
{
    const REAL x = in[0], y = in[1], z = in[2], c = FN(cosine)(in[3]), s = FN(sine)(in[3]), d = 1 - c;
    const REAL m[3][3] = {{c + x * x * d, x * y * d - z * s, x * z * d + y * s},
                          {x * y * d + z * s, c + y * y * d, y * z * d - x * s},
                          {x * z * d - y * s, y * z * d + x * s, c + z * z * d}};
    const REAL w = FN(root)(1 + m[0][0] + m[1][1] + m[2][2]) / 2, p[3] = {(REAL)0.2, (REAL)-1.3, (REAL)2.2};
    const REAL q[4] = {(m[2][1] - m[1][2]) / (4 * w), (m[0][2] - m[2][0]) / (4 * w), (m[1][0] - m[0][1]) / (4 * w), w};
    FN(rotate)(q, p, out);
}

// directions a, b -> the angle between them
static void FN(angle_between)(const REAL *in, REAL *out)
{
    const REAL *a = in, *b = in + 3;
    const REAL la = FN(root)(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    const REAL lb = FN(root)(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
    out[0] = FN(arc_cosine)((a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (la * lb));
}

// vector -> unit vector
static void FN(unit)(const REAL *in, REAL *out)
{
    const REAL length = FN(root)(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]);
    for (int i = 0; i < 3; i++)
        out[i] = in[i] / length;
}

// quaternion -> unit quaternion
static void FN(unit_quat)(const REAL *in, REAL *out)
{
    const REAL length = FN(root)(in[0] * in[0] + in[1] * in[1] + in[2] * in[2] + in[3] * in[3]);
    for (int i = 0; i < 4; i++)
        out[i] = in[i] / length;
}

static void FN(distort)(REAL k1, REAL k2, REAL x, REAL y, REAL *xd, REAL *yd)
{
    const REAL r2 = x * x + y * y, radial = 1 + r2 * (k1 + r2 * k2);
    *xd = x * radial;
    *yd = y * radial;
}

// point x, y, z; f, c, k1, k2 -> pixel
static void FN(project)(const REAL *in, REAL *out)
{
    REAL x, y;
    FN(distort)(in[5], in[6], in[0] / in[2], in[1] / in[2], &x, &y);
    out[0] = in[3] * x + in[4];
    out[1] = in[3] * y + in[4];
}

// pixel x, y; f, c, k1, k2 -> ray on z = 1, by the fixed point that textbooks give, five rounds
static void FN(undistort)(const REAL *in, REAL *out)
{
    const REAL xd = (in[0] - in[3]) / in[2], yd = (in[1] - in[3]) / in[2];
    REAL x = xd, y = yd;
    for (int i = 0; i < 5; i++) {
        const REAL r2 = x * x + y * y, radial = 1 + r2 * (in[4] + r2 * in[5]);
        x = xd / radial;
        y = yd / radial;
    }
    out[0] = x;
    out[1] = y;
}

// depth in[0] on the ray (0.3, -0.2, 1) of a camera rotated by in[2] about z, in[1] metres from the origin along each
// axis -> the point in camera axes, by way of the world
static void FN(there_and_back)(const REAL *in, REAL *out)
{
    const REAL q[4] = {0, 0, FN(sine)(in[2] / 2), FN(cosine)(in[2] / 2)}, back[4] = {0, 0, -q[2], q[3]};
    const REAL p[3] = {(REAL)0.3 * in[0], (REAL)-0.2 * in[0], in[0]};
    REAL w[3];
    FN(rotate)(q, p, w);
    for (int i = 0; i < 3; i++)
        w[i] = (w[i] + in[1]) - in[1];
    FN(rotate)(back, w, out);
}

// x, y -> length
static void FN(hypot)(const REAL *in, REAL *out) { out[0] = FN(root)(in[0] * in[0] + in[1] * in[1]); }

// x -> exp(x) by its power series about 0
static void FN(exp)(const REAL *in, REAL *out)
{
    REAL term = 1, sum = 1;
    for (int k = 1; k < 300; k++) {
        term *= in[0] / (REAL)k;
        sum += term;
    }
    out[0] = sum;
}

// x -> sin(x) by its power series about 0
static void FN(sin)(const REAL *in, REAL *out)
{
    REAL term = in[0], sum = in[0];
    for (int k = 1; k < 300; k++) {
        term *= -in[0] * in[0] / (REAL)(2 * k * (2 * k + 1));
        sum += term;
    }
    out[0] = sum;
}

// bone lengths a, b, distance d between root and end -> interior angle of the middle joint (law of cosines)
static void FN(elbow)(const REAL *in, REAL *out)
{
    const REAL a = in[0], b = in[1], d = in[2];
    out[0] = FN(arc_cosine)((a * a + b * b - d * d) / (2 * a * b));
}

// radius, distance -> half the angle under which a sphere is seen
static void FN(asin_half_width)(const REAL *in, REAL *out) { out[0] = FN(arc_sine)(in[0] / in[1]); }

// step, count -> the steps added one after the other
static void FN(sum_of_steps)(const REAL *in, REAL *out)
{
    REAL sum = 0;
    for (long i = 0; i < (long)in[1]; i++)
        sum += in[0];
    out[0] = sum;
}

// a square's corners on z = 1 (x, y of four), side -> distance of its centre from the camera, from the homography
static void FN(square_range)(const REAL *in, REAL *out)
{
    const REAL *p = in, side = in[8];
    const REAL dx1 = p[2] - p[4], dx2 = p[6] - p[4], sx = p[0] - p[2] + p[4] - p[6];
    const REAL dy1 = p[3] - p[5], dy2 = p[7] - p[5], sy = p[1] - p[3] + p[5] - p[7];
    const REAL det = dx1 * dy2 - dx2 * dy1, g = (sx * dy2 - dx2 * sy) / det, k = (dx1 * sy - sx * dy1) / det;
    const REAL a = p[2] - p[0] + g * p[2], b = p[6] - p[0] + k * p[6], d = p[3] - p[1] + g * p[3],
               e = p[7] - p[1] + k * p[7];
    const REAL c[3] = {p[0] + (a + b) / 2, p[1] + (d + e) / 2, 1 + (g + k) / 2};
    const REAL first = FN(root)(a * a + d * d + g * g), second = FN(root)(b * b + e * e + k * k);
    const REAL length = FN(root)(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    out[0] = length * side / ((first + second) / 2);
}

// 2 x 2 normal equations of a line y = m x + n through three points at x = in[0], in[0] + in[1], in[0] + 2 in[1] that
// lie on y = 2 x + 1 - 2 in[0] -> m
static void FN(solve2)(const REAL *in, REAL *out)
{
    REAL xx = 0, x1 = 0, xy = 0, y1 = 0;
    for (int i = 0; i < 3; i++) {
        const REAL x = in[0] + in[1] * (REAL)i, y = 2 * (x - in[0]) + 1;
        xx += x * x;
        x1 += x;
        xy += x * y;
        y1 += y;
    }
    out[0] = (3 * xy - x1 * y1) / (3 * xx - x1 * x1);
}

// a covariance of standard deviations in[0] along (3, 4, 0) / 5 and in[1] across -> the least variance, by determinant
static void FN(variance_along)(const REAL *in, REAL *out)
{
    const REAL u = (REAL)3 / 5, v = (REAL)4 / 5, a2 = in[0] * in[0], b2 = in[1] * in[1];
    const REAL xx = a2 * u * u + b2 * v * v, xy = (a2 - b2) * u * v, yy = a2 * v * v + b2 * u * u;
    out[0] = (xx * yy - xy * xy) / a2;
}

// readout, height, row -> when the row is read after the middle one
static void FN(row_time)(const REAL *in, REAL *out) { out[0] = in[0] * (in[2] - (in[1] - 1) / 2) / (in[1] - 1); }

// base line b, depth z, point straight ahead of the first camera -> z, from both rays by the normal equations
static void FN(triangulate)(const REAL *in, REAL *out)
{
    const REAL b = in[0], z = in[1], length = FN(root)(b * b + z * z), u[2] = {-b / length, z / length};
    // |s (0, 1) - (b, 0) - t u|^2 least over s, t
    const REAL mixed = -u[1], det = 1 - mixed * mixed, right_t = -b * u[0];
    out[0] = (0 - mixed * right_t) / det;
}
