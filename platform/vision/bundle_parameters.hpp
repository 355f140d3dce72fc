// The parameters of bundle_adjustment.h as Ceres sees them; shared by bundle_adjustment.cpp and bundle_covariance.cpp
// only. In names, by_x is the derivative with respect to x.
#pragma once
#include "platform/vision/bundle_adjustment.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <vector>

namespace bundle
{

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Read3 = Eigen::Map<const Vector3>;

// A pose as Ceres's parameters: a rotation applied to the initial one, and a translation. Blocks of three numbers only:
// Ceres has fixed-size code for these sizes, and no block needs a manifold.
struct pose_block {
    Matrix3 start;
    double gibbs[3]; // twice the Gibbs vector of the rotation: its axis times 2 tan(angle / 2)
    double shift[3]; // the translation
};

inline Matrix3 cross(const Vector3 &v)
{
    Matrix3 m;
    m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
    return m;
}

// The pose of a block at the parameter values of one evaluation.
struct evaluated_pose {
    Matrix3 rotation;
    Matrix3 by_gibbs; // rotation vector, in the outer frame, by a change of `gibbs`
    Vector3 shift;

    evaluated_pose(const Matrix3 &start, const double *gibbs, const double *translation) : shift(Read3(translation))
    {
        Vector3 g = Read3(gibbs) / 2;
        double square = g.squaredNorm();
        Matrix3 cross_g = cross(g);
        rotation = ((1 - square) * Matrix3::Identity() + 2 * (g * g.transpose() + cross_g)) / (1 + square) * start;
        by_gibbs = (Matrix3::Identity() + cross_g) / (1 + square);
    }

    // Derivative of rotation * p by `gibbs`.
    Matrix3 rotated_by_gibbs(const Vector3 &p) const { return -cross(rotation * p) * by_gibbs; }
};

inline Eigen::Quaterniond rotation_of(const pose &p)
{
    return {p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z};
}

inline pose_block pose_block_from(const pose &p)
{
    return {rotation_of(p).toRotationMatrix(), {0, 0, 0}, {p.translation.x, p.translation.y, p.translation.z}};
}

inline pose pose_from(const pose &start, const pose_block &m)
{
    if (Read3(m.gibbs).isZero(0)) // held poses keep their bits
        return {start.rotation, {m.shift[0], m.shift[1], m.shift[2]}};
    const Eigen::Quaterniond rotated =
        (Eigen::Quaterniond(1, m.gibbs[0] / 2, m.gibbs[1] / 2, m.gibbs[2] / 2) * rotation_of(start)).normalized();
    return {{rotated.x(), rotated.y(), rotated.z(), rotated.w()}, {m.shift[0], m.shift[1], m.shift[2]}};
}

// Ceres's parameters: copies, so that a failed solution does not change the caller's.
struct solver_state {
    std::vector<pose_block> cameras, squares;
    std::vector<vec3> points;
    double depth_scale;
    double lens[BA_LENS_NUMBERS];

    explicit solver_state(const ba_problem &in)
        : points(in.points, in.points + in.point_count),
          depth_scale(in.depth_scale ? *in.depth_scale : 1), lens{1, 1, 0, 0, 0}
    {
        if (in.lens) {
            const ba_lens &l = *in.lens;
            const double start[BA_LENS_NUMBERS] = {l.focal[0], l.focal[1], l.shift[0], l.shift[1], l.bend};
            std::copy(start, start + BA_LENS_NUMBERS, lens);
        }
        for (int32_t i = 0; i < in.camera_count; i++)
            cameras.push_back(pose_block_from(in.cameras[i].camera_from_world));
        for (int32_t i = 0; i < in.square_count; i++)
            squares.push_back(pose_block_from(in.squares[i].world_from_square));
    }

    void write_back(const ba_problem &in) const
    {
        for (int32_t i = 0; i < in.camera_count; i++)
            in.cameras[i].camera_from_world = pose_from(in.cameras[i].camera_from_world, cameras[(size_t)i]);
        for (int32_t i = 0; i < in.square_count; i++)
            in.squares[i].world_from_square = pose_from(in.squares[i].world_from_square, squares[(size_t)i]);
        for (int32_t i = 0; i < in.point_count; i++)
            in.points[i] = points[(size_t)i];
        if (in.depth_scale)
            *in.depth_scale = depth_scale;
        if (in.lens) {
            std::copy(lens, lens + 2, in.lens->focal);
            std::copy(lens + 2, lens + 4, in.lens->shift);
            in.lens->bend = lens[4];
        }
    }
};

// Fills in.square_covariance and the lens's, as far as they are asked for, at the solution in `c`.
// bundle_covariance.cpp.
void find_covariance(const ba_problem &in, solver_state &c, ceres::Problem &problem);

} // namespace bundle
