#include "capture/tracking/person_check.h"

#include "capture/tracking/pose_init.h"

// What is detected from scratch must be better than this to be a person. Of 270 starts on real people (nine sequences
// of kinect-actions, 30 images each) the worst had energy 127 and log-odds of 6 against its shape; of 60 images of two
// empty rooms the first three leave 5 starts on furniture, and the visible area leaves 2.
#define CLOSE_M              0.03
#define CLOSE_SHARE_MIN      0.72  // within CLOSE_M
#define PERSON_ENERGY_MAX    150.0 // of the fit: twice that of 150 independent points that are off by their sigma
#define PERSON_SHAPE_MAX     10.0  // log-odds against the shape
#define FLAT_SHARE_MAX       0.8   // of the points, within FLAT_M of one plane; of busts at 0.9 m up to 0.7, of whole
#define FLAT_M               0.02  // bodies 0.4
#define HEADLESS_AREA_MIN_M2 0.25  // visible of a person whose head is not: less can be anything's edge
enum { FLAT_ROUNDS = 12 };         // of its fit

// The share of the points that lie within FLAT_M of one plane, fitted with the kernel of Geman and McClure.
static double flat_share(const struct depth_evidence *evidence)
{
    // A plane is linear in inverse depth: 1/z = a x/z + b y/z + c. Iteratively reweighted least squares.
    double plane[3] = {0}, share = 0;
    for (int round = 0; round < FLAT_ROUNDS; round++) {
        double h[3][4] = {{0}};
        int near = 0;
        for (int i = 0; i < evidence->count; i++) {
            const struct vec3 p = evidence->point[i].p;
            const double row[4] = {p.x / p.z, p.y / p.z, 1, 1 / p.z};
            const double off = round ? p.z * p.z * (row[0] * plane[0] + row[1] * plane[1] + plane[2] - row[3]) : 0;
            const double fade = FLAT_M * FLAT_M / (FLAT_M * FLAT_M + off * off),
                         w = p.z * p.z * p.z * p.z * fade * fade;
            near += fabs(off) < FLAT_M;
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 4; c++)
                    h[r][c] += w * row[r] * row[c];
        }
        share = (double)near / evidence->count;
        for (int k = 0; k < 3; k++)
            for (int r = 0; r < 3; r++) {
                const double by = r == k ? 0 : h[r][k] / h[k][k];
                for (int c = k; c < 4; c++)
                    h[r][c] -= by * h[k][c];
            }
        for (int k = 0; k < 3; k++)
            plane[k] = h[k][3] / h[k][k];
    }
    return share;
}

// Whether any point is on the fitted head.
static bool shows_head(const struct depth_evidence *evidence, const struct fit_result *fit)
{
    for (int i = 0; i < evidence->count; i++)
        if (fit->build.solid[fit->solid[i]].segment == SEG_HEAD && fabs((double)fit->residual[i]) < CLOSE_M)
            return true;
    return false;
}

bool is_like_person(const struct depth_evidence *evidence, const struct fit_result *fit)
{
    return explained_share(evidence, fit, CLOSE_M) > CLOSE_SHARE_MIN && fit->energy < PERSON_ENERGY_MAX &&
           shape_log_odds(&fit->shape) < PERSON_SHAPE_MAX && flat_share(evidence) < FLAT_SHARE_MAX &&
           (shows_head(evidence, fit) || evidence->extent_m2 > HEADLESS_AREA_MIN_M2);
}
