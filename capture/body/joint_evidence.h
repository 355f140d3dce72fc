// Evidence about a body from joints that a network found in the same depth image (body_network.h): each should lie
// where it was found, within its standard deviation.
//
// The network may be wrong, about both sides at once. Each joint therefore has the robust kernel of Geman and McClure
// (1985), 0.5 w e^2 c^2 / (c^2 + e^2), e its distance in standard deviations: a wrong joint saturates. Energies are
// log-odds as in body_fit.h; all joints of an image together have at most JOINTS_INDEPENDENT times what one has.
//
// Depth camera's axes, metres. Pure; safe from any thread.
#pragma once
#include "capture/body/body_model.h"
#include "capture/body/body_network.h"

struct joint_evidence {
    struct vec3 joint[JOINT_COUNT];
    double sigma_m[JOINT_COUNT]; // INFINITY: it was not found
    struct vec3 left;            // as found_body's
};

void joint_evidence_read(struct joint_evidence *out, const struct found_body *found);

struct normal_equations;

// The joints' energy; adds them to the normal equations. system NULL: the energy alone. evidence NULL: 0.
double joint_evidence_energy(const struct joint_evidence *evidence, const struct body_build *build,
                             struct normal_equations *system);

// With the places of a straight trunk's joints where some of the trunk's were not found, as of who is out of the
// picture above or below the hips; what of its direction the others do not tell is upright and to `left`. Where none
// was found, nothing changes. The standard deviations stay.
struct joint_evidence joint_evidence_complete(const struct joint_evidence *evidence, const struct body_shape *shape,
                                              struct vec3 up);

// A body of this shape in the pose that has its joints where the evidence has them, as nearly as it can, the trunk's
// completed. Of a limb what was not found goes on straight, or hangs down.
struct body_pose joint_evidence_pose(const struct joint_evidence *evidence, const struct body_shape *shape,
                                     struct vec3 up);

// The height of a body with such joints, by the median of its bones; where too few were found, the average.
double joint_evidence_height_m(const struct joint_evidence *evidence);

// The same joints with left and right exchanged.
struct joint_evidence joint_evidence_mirrored(const struct joint_evidence *evidence);
