#include "platform/adjust.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <cstddef>
#include <memory>
#include <new>
#include <vector>

// Ceres sees a pose as seven doubles: x, y, z, w of the rotation, then the shift.
static_assert(sizeof(struct pose) == 7 * sizeof(double) && offsetof(struct pose, translation) == 4 * sizeof(double),
              "struct pose is not seven doubles");
static_assert(sizeof(struct vec3) == 3 * sizeof(double), "struct vec3 is not three doubles");

namespace
{

constexpr double ROBUST = 3; // standard deviations
constexpr double NEAREST_M = 1e-3;

template <typename T> void turn(const T *q, const T *p, T *out) // q: x, y, z, w
{
    T tx = T(2) * (q[1] * p[2] - q[2] * p[1]);
    T ty = T(2) * (q[2] * p[0] - q[0] * p[2]);
    T tz = T(2) * (q[0] * p[1] - q[1] * p[0]);
    out[0] = p[0] + q[3] * tx + q[1] * tz - q[2] * ty;
    out[1] = p[1] + q[3] * ty + q[2] * tx - q[0] * tz;
    out[2] = p[2] + q[3] * tz + q[0] * ty - q[1] * tx;
}

template <typename T> void move(const T *pose, const T *p, T *out)
{
    turn(pose, p, out);
    for (int i = 0; i < 3; i++)
        out[i] += pose[4 + i];
}

struct corner_error {
    const adjust_corners *seen;
    double half, fx, fy;

    template <typename T> bool operator()(const T *camera, const T *square, T *residual) const
    {
        T e[8];
        for (int k = 0; k < 4; k++) {
            T own[3] = {T(k == 1 || k == 2 ? half : -half), T(k >= 2 ? half : -half), T(0)}, world[3], p[3];
            move(square, own, world);
            move(camera, world, p);
            if (!(p[2] > NEAREST_M))
                return false;
            e[2 * k] = fx * p[0] / p[2] - seen->observed[2 * k];
            e[2 * k + 1] = fy * p[1] / p[2] - seen->observed[2 * k + 1];
        }
        for (int i = 0; i < 8; i++) {
            residual[i] = T(0);
            for (int j = 0; j < 8; j++)
                residual[i] += seen->whiten[i][j] * e[j];
        }
        return true;
    }
};

struct plane_error {
    const adjust_plane_depth *seen;

    template <typename T> bool operator()(const T *camera, const T *square, T *residual) const
    {
        T up[3] = {T(0), T(0), T(1)}, across[3], normal[3], centre[3];
        turn(square, up, across);
        turn(camera, across, normal);
        move(camera, square + 4, centre);
        T slant = normal[0] * seen->x + normal[1] * seen->y + normal[2];
        if (!(slant * slant > 1e-6))
            return false;
        T z = (normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2]) / slant;
        residual[0] = (z - seen->z) / seen->sigma_m;
        return true;
    }
};

// By far the most frequent error, so its derivatives are written out.
class point_error : public ceres::SizedCostFunction<3, 7, 3>
{
  public:
    // What makes an error on the plane z = 1 one of unit covariance: [of_x 0; of_both of_y].
    point_error(const adjust_sighting *s, double fx, double fy) : seen(s)
    {
        double xx = s->covariance[0], xy = s->covariance[1], yy = s->covariance[2];
        of_x = fx / std::sqrt(xx);
        of_y = fy / std::sqrt(yy - xy * xy / xx);
        of_both = -of_y * xy / xx * fx / fy;
    }

    bool Evaluate(double const *const *parameters, double *residual, double **by) const override
    {
        const double *camera = parameters[0], *point = parameters[1];
        double p[3];
        move(camera, point, p);
        if (!(p[2] > NEAREST_M))
            return false;
        double uz = seen->z > 0 ? 1 / seen->sigma_m : 0;
        double x = p[0] / p[2], y = p[1] / p[2];
        residual[0] = of_x * (x - seen->x);
        residual[1] = of_both * (x - seen->x) + of_y * (y - seen->y);
        residual[2] = (p[2] - seen->z) * uz;
        if (!by)
            return true;
        const double by_p[3][3] = {
            {of_x / p[2], 0, -of_x * x / p[2]},
            {of_both / p[2], of_y / p[2], -(of_both * x + of_y * y) / p[2]},
            {0, 0, uz}};
        if (by[0]) {
            double turned[3][4]; // derivative of turn() by x, y, z, w
            turn_by_rotation(camera, point, turned);
            for (int r = 0; r < 3; r++) {
                for (int c = 0; c < 4; c++)
                    by[0][7 * r + c] =
                        by_p[r][0] * turned[0][c] + by_p[r][1] * turned[1][c] + by_p[r][2] * turned[2][c];
                for (int c = 0; c < 3; c++)
                    by[0][7 * r + 4 + c] = by_p[r][c];
            }
        }
        for (int c = 0; by[1] && c < 3; c++) {
            const double axis[3] = {c == 0 ? 1.0 : 0, c == 1 ? 1.0 : 0, c == 2 ? 1.0 : 0};
            double column[3];
            turn(camera, axis, column);
            for (int r = 0; r < 3; r++)
                by[1][3 * r + c] = by_p[r][0] * column[0] + by_p[r][1] * column[1] + by_p[r][2] * column[2];
        }
        return true;
    }

  private:
    // p + 2 w (u x p) + 2 (u (u.p) - p (u.u)), u = (x, y, z)
    static void turn_by_rotation(const double *q, const double *p, double out[3][4])
    {
        double dot = q[0] * p[0] + q[1] * p[1] + q[2] * p[2];
        const double cross[3][3] = {{0, p[2], -p[1]}, {-p[2], 0, p[0]}, {p[1], -p[0], 0}}; // of u x p by u
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++)
                out[r][c] = 2 * (q[3] * cross[r][c] + q[r] * p[c] - 2 * p[r] * q[c] + (r == c ? dot : 0));
            out[r][3] = 2 * (cross[r][0] * q[0] + cross[r][1] * q[1] + cross[r][2] * q[2]);
        }
    }

    const adjust_sighting *seen;
    double of_x, of_both, of_y;
};

void add_errors(const adjust_problem &in, std::vector<adjust_camera> &cameras, std::vector<adjust_square> &squares,
                std::vector<vec3> &points, ceres::Problem &problem)
{
    auto pose_of_camera = [&](int32_t i) { return &cameras[(size_t)i].camera_from_world.rotation.x; };
    auto pose_of_square = [&](int32_t i) { return &squares[(size_t)i].world_from_square.rotation.x; };
    auto *corner_loss = new ceres::CauchyLoss(ROBUST * std::sqrt(8.0)); // of all eight numbers
    auto *depth_loss = new ceres::CauchyLoss(ROBUST);
    auto *point_loss = new ceres::CauchyLoss(ROBUST);
    std::vector<std::unique_ptr<ceres::LossFunction>> owner; // the problem owns what it uses
    if (!in.corner_count)
        owner.emplace_back(corner_loss);
    if (!in.plane_depth_count)
        owner.emplace_back(depth_loss);
    if (!in.sighting_count)
        owner.emplace_back(point_loss);
    for (int32_t i = 0; i < in.corner_count; i++) {
        const adjust_corners &c = in.corners[i];
        auto *error = new corner_error{&c, squares[(size_t)c.square].side_m / 2, in.fx, in.fy};
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<corner_error, 8, 7, 7>(error), corner_loss,
                                 pose_of_camera(c.camera), pose_of_square(c.square));
    }
    for (int32_t i = 0; i < in.plane_depth_count; i++) {
        const adjust_plane_depth &d = in.plane_depths[i];
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<plane_error, 1, 7, 7>(new plane_error{&d}), depth_loss,
                                 pose_of_camera(d.camera), pose_of_square(d.square));
    }
    for (int32_t i = 0; i < in.sighting_count; i++) {
        const adjust_sighting &s = in.sightings[i];
        problem.AddResidualBlock(new point_error(&s, in.fx, in.fy), point_loss, pose_of_camera(s.camera),
                                 &points[(size_t)s.point].x);
    }
}

enum status solve(const adjust_problem &in)
{
    // A failed solution must not reach the caller's numbers, so Ceres works on copies.
    std::vector<adjust_camera> cameras(in.cameras, in.cameras + in.camera_count);
    std::vector<adjust_square> squares(in.squares, in.squares + in.square_count);
    std::vector<vec3> points(in.points, in.points + in.point_count);
    ceres::Problem problem;
    add_errors(in, cameras, squares, points, problem);

    auto *order = new ceres::ParameterBlockOrdering;
    auto *manifold = new ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;
    bool manifold_used = false;
    auto add_pose = [&](double *block, int group) {
        if (!problem.HasParameterBlock(block))
            return false;
        problem.SetManifold(block, manifold);
        manifold_used = true;
        order->AddElementToGroup(block, group);
        return true;
    };
    // The group with most blocks is eliminated first; its blocks never meet in one error.
    // What is held is in no equation, so held points are no such group.
    int camera_group = std::any_of(in.sightings, in.sightings + in.sighting_count,
                                   [&](const adjust_sighting &s) { return s.point >= in.held_points; })
                           ? 1
                           : 0;
    for (size_t i = 0; i < cameras.size(); i++)
        if (add_pose(&cameras[i].camera_from_world.rotation.x, camera_group) &&
            (in.hold_cameras || (int32_t)i == in.held_camera))
            problem.SetParameterBlockConstant(&cameras[i].camera_from_world.rotation.x);
    for (size_t i = 0; i < squares.size(); i++)
        if (add_pose(&squares[i].world_from_square.rotation.x, 1) && squares[i].held)
            problem.SetParameterBlockConstant(&squares[i].world_from_square.rotation.x);
    for (size_t i = 0; i < points.size(); i++) {
        if (!problem.HasParameterBlock(&points[i].x))
            continue;
        order->AddElementToGroup(&points[i].x, 0);
        if ((int32_t)i < in.held_points)
            problem.SetParameterBlockConstant(&points[i].x);
    }

    ceres::Solver::Options options;
    options.linear_solver_ordering.reset(order);
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.num_threads = 1;
    options.max_num_iterations = in.most_rounds;
    options.function_tolerance = 1e-6;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!manifold_used)
        delete manifold;
    if (!summary.IsSolutionUsable())
        return fail(ERR_SOLVER, "the joint adjustment of cameras and tags found no solution");
    if (in.cost)
        *in.cost = summary.final_cost;
    for (int32_t i = 0; i < in.camera_count; i++)
        in.cameras[i] = cameras[(size_t)i];
    for (int32_t i = 0; i < in.square_count; i++)
        in.squares[i] = squares[(size_t)i];
    for (int32_t i = 0; i < in.point_count; i++)
        in.points[i] = points[(size_t)i];
    return OK;
}

} // namespace

enum status adjust(const struct adjust_problem *problem)
{
    try {
        return solve(*problem);
    } catch (const std::bad_alloc &) {
        return fail(ERR_MEMORY, "no memory to adjust %d cameras and %d points", (int)problem->camera_count,
                    (int)problem->point_count);
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "the joint adjustment failed: %s", e.what());
    }
}
