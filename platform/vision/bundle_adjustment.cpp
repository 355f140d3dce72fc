// bundle_adjustment.h with Ceres. In names, by_x is the derivative with respect to x.
#include "platform/vision/bundle_adjustment.h"

#include "platform/vision/memory_reserve.hpp"

#include <algorithm>
#include <array>
#include <ceres/ceres.h>
#include <memory>
#include <new>
#include <vector>

static_assert(sizeof(struct vec3) == 3 * sizeof(double), "struct vec3 is not three doubles");

namespace
{

// ---------------------------------------------------------------- parameters as Ceres sees them

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

// ---------------------------------------------------------------- errors where the lens is estimated

// Differentiated automatically: a lens is fitted once a map, not in the loop that builds it.

template <class T> using vector3 = Eigen::Matrix<T, 3, 1>;

// The rotation of a pose block: evaluated_pose's, of any scalar.
template <class T> vector3<T> rotated(const Matrix3 &start, const T *gibbs, const vector3<T> &p)
{
    const vector3<T> half = Eigen::Map<const vector3<T>>(gibbs) / T(2), q = start.cast<T>() * p, across = half.cross(q);
    return q + (across + half.cross(across)) * (T(2) / (T(1) + half.squaredNorm()));
}

template <class T> vector3<T> moved(const Matrix3 &start, const T *gibbs, const T *shift, const vector3<T> &p)
{
    return rotated<T>(start, gibbs, p) + Eigen::Map<const vector3<T>>(shift);
}

// Where a point in camera axes appears on the plane z = 1 of the lens as it was given. lens: as ba_lens.
template <class T> Eigen::Matrix<T, 2, 1> appears_at(const T *lens, const vector3<T> &p)
{
    const T x = p[0] / p[2], y = p[1] / p[2], bent = T(1) + lens[4] * (x * x + y * y);
    return {lens[0] * x * bent + lens[2], lens[1] * y * bent + lens[3]};
}

// Blocks: the camera's rotation and translation, the square's, the lens.
struct lens_corner_error {
    const ba_corners *seen;
    const pose_block *camera, *square;
    double half, fx, fy;

    template <class T>
    bool operator()(const T *turn, const T *shift, const T *own_turn, const T *own_shift, const T *lens, T *out) const
    {
        T off[8];
        for (int k = 0; k < 4; k++) {
            const vector3<T> own(T(k == 1 || k == 2 ? half : -half), T(k >= 2 ? half : -half), T(0));
            const vector3<T> p =
                moved<T>(camera->start, turn, shift, moved<T>(square->start, own_turn, own_shift, own));
            if (!(p[2] > T(1e-3)))
                return false;
            const Eigen::Matrix<T, 2, 1> at = appears_at<T>(lens, p);
            off[2 * k] = fx * at[0] - seen->observed[2 * k];
            off[2 * k + 1] = fy * at[1] - seen->observed[2 * k + 1];
        }
        for (int i = 0; i < 8; i++) {
            out[i] = T(0);
            for (int j = 0; j < 8; j++)
                out[i] += seen->whiten[i][j] * off[j];
        }
        return true;
    }
};

// One more block: the factor of measured depths.
struct lens_plane_error {
    const ba_plane_depth *seen;
    const pose_block *camera, *square;

    template <class T>
    bool operator()(const T *turn, const T *shift, const T *own_turn, const T *own_shift, const T *lens, const T *scale,
                    T *out) const
    {
        const T x = (seen->x - lens[2]) / lens[0], y = (seen->y - lens[3]) / lens[1];
        const T straight = T(1) / (T(1) + lens[4] * (x * x + y * y));
        const vector3<T> ray(x * straight, y * straight, T(1));
        const vector3<T> normal =
            rotated<T>(camera->start, turn, rotated<T>(square->start, own_turn, vector3<T>(T(0), T(0), T(1))));
        const vector3<T> centre =
            moved<T>(camera->start, turn, shift, vector3<T>(own_shift[0], own_shift[1], own_shift[2]));
        const T slant = normal.dot(ray);
        if (!(slant * slant > T(1e-6)))
            return false;
        out[0] = (normal.dot(centre) / slant - scale[0] * seen->z) / seen->sigma_m;
        return true;
    }
};

// Blocks: the camera's rotation and translation, the point, the lens, the factor of measured depths.
struct lens_point_error {
    const ba_observation *seen;
    const pose_block *camera;
    double of_x, of_both, of_y; // [of_x 0; of_both of_y] whitens an error on the plane z = 1

    lens_point_error(const ba_observation *s, const pose_block *of_camera, double fx, double fy)
        : seen(s), camera(of_camera)
    {
        const double xx = s->covariance[0], xy = s->covariance[1], yy = s->covariance[2];
        of_x = fx / std::sqrt(xx);
        of_y = fy / std::sqrt(yy - xy * xy / xx);
        of_both = -of_y * xy / xx * fx / fy;
    }

    template <class T>
    bool operator()(const T *turn, const T *shift, const T *point, const T *lens, const T *scale, T *out) const
    {
        const vector3<T> p = moved<T>(camera->start, turn, shift, vector3<T>(point[0], point[1], point[2]));
        if (!(p[2] > T(1e-3)))
            return false;
        const Eigen::Matrix<T, 2, 1> at = appears_at<T>(lens, p);
        const T x = at[0] - seen->x, y = at[1] - seen->y;
        out[0] = of_x * x;
        out[1] = of_both * x + of_y * y;
        out[2] = seen->z > 0 ? (p[2] - scale[0] * seen->z) / seen->sigma_m : T(0);
        return true;
    }
};

// The prior of the lens: the given one, with standard deviations that no lens worth the name exceeds and that keep the
// problem from being singular.
struct lens_prior {
    template <class T> bool operator()(const T *lens, T *out) const
    {
        const double sigma[5] = {0.5, 0.5, 0.3, 0.3, 0.5};
        for (int i = 0; i < 5; i++)
            out[i] = (lens[i] - (i < 2 ? 1.0 : 0.0)) / sigma[i];
        return true;
    }
};

// ---------------------------------------------------------------- covariances

// The covariance of the squares' poses and of the lens after bundle adjustment: the inverse of the poses' information
// with points marginalised (Schur complement), scaled by estimated variance components.

// The blocks that are not held, points first, with their columns in the Jacobian.
struct jacobian_columns {
    std::vector<double *> blocks;
    std::vector<int> square; // first of its six columns (rotation, translation); -1: held or not observed
    int lens = -1;           // first of its columns
    int points = 0, all = 0;

    jacobian_columns(const ba_problem &in, solver_state &c, const ceres::Problem &problem)
    {
        for (int32_t i = in.held_points; i < in.point_count; i++)
            add(problem, &c.points[(size_t)i].x, 3);
        points = all;
        for (pose_block &m : c.cameras) {
            add(problem, m.gibbs, 3);
            add(problem, m.shift, 3);
        }
        for (pose_block &m : c.squares) {
            square.push_back(problem.HasParameterBlock(m.gibbs) && !problem.IsParameterBlockConstant(m.gibbs) ? all
                                                                                                              : -1);
            add(problem, m.gibbs, 3);
            add(problem, m.shift, 3);
        }
        if (in.depth_scale)
            add(problem, &c.depth_scale, 1);
        if (in.lens) {
            lens = all;
            add(problem, c.lens, BA_LENS_NUMBERS);
        }
    }

  private:
    void add(const ceres::Problem &problem, double *block, int size)
    {
        if (!problem.HasParameterBlock(block) || problem.IsParameterBlockConstant(block))
            return;
        blocks.push_back(block);
        all += size;
    }
};

// The Jacobian of the whitened errors, by rows.
struct sparse_jacobian {
    ceres::CRSMatrix all;
    int points; // columns of points: the first ones

    int begin(int row) const { return all.rows[(size_t)row]; }
    int end(int row) const { return all.rows[(size_t)row + 1]; }
    int column(int i) const { return all.cols[(size_t)i]; }
    double value(int i) const { return all.values[(size_t)i]; }
};

// The Schur complement's term of one point, as a factor: out * out' is to be subtracted from the poses' information.
// rows: those of the point's errors. out: three columns.
void add_point(const sparse_jacobian &jacobian, const std::vector<int> &rows, Eigen::Ref<Eigen::MatrixXd> out)
{
    Matrix3 own = Matrix3::Zero();
    for (int r : rows) {
        Vector3 by_point = Vector3::Zero();
        for (int i = jacobian.begin(r); i < jacobian.end(r); i++)
            if (jacobian.column(i) < jacobian.points)
                by_point[jacobian.column(i) % 3] = jacobian.value(i);
        own += by_point * by_point.transpose();
        for (int i = jacobian.begin(r); i < jacobian.end(r); i++)
            if (jacobian.column(i) >= jacobian.points)
                out.row(jacobian.column(i) - jacobian.points) += jacobian.value(i) * by_point.transpose();
    }
    const Eigen::LLT<Matrix3> factor(own);
    out = factor.matrixL().solve(out.transpose()).transpose().eval();
    if (!out.allFinite()) // singular (observed along one line): no information of its own to subtract
        out.setZero();
}

// Kinds of residuals, in the order in which they are added. PRIOR: of the depth scale and the lens.
enum kind { CORNERS, PLANE_DEPTHS, OBSERVATIONS, PRIOR, KINDS };

kind kind_of_row(const ba_problem &in, int row)
{
    const int corners = 8 * in.corner_count, plane_depths = corners + in.plane_depth_count,
              observations = plane_depths + 3 * in.observation_count;
    return row < corners ? CORNERS : row < plane_depths ? PLANE_DEPTHS : row < observations ? OBSERVATIONS : PRIOR;
}

// The poses' information from each kind of residuals, with points marginalised. Lower triangles.
std::array<Eigen::MatrixXd, KINDS> information_of_poses(const ba_problem &in, const sparse_jacobian &jacobian)
{
    enum { POINTS_AT_A_TIME = 64 };
    const int poses = jacobian.all.num_cols - jacobian.points, count = jacobian.points / 3;
    std::array<Eigen::MatrixXd, KINDS> information;
    information.fill(Eigen::MatrixXd::Zero(poses, poses));
    Eigen::MatrixXd some(poses, 3 * POINTS_AT_A_TIME);
    std::vector<std::vector<int>> rows((size_t)count); // of each point
    for (int r = 0; r < jacobian.all.num_rows; r++) {
        Eigen::MatrixXd &own = information[kind_of_row(in, r)];
        int point = -1;
        for (int i = jacobian.begin(r); i < jacobian.end(r); i++) {
            if (jacobian.column(i) < jacobian.points)
                point = jacobian.column(i) / 3;
            for (int k = jacobian.begin(r); jacobian.column(i) >= jacobian.points && k < jacobian.end(r); k++)
                if (jacobian.column(k) >= jacobian.column(i))
                    own(jacobian.column(k) - jacobian.points, jacobian.column(i) - jacobian.points) +=
                        jacobian.value(i) * jacobian.value(k);
        }
        if (point >= 0)
            rows[(size_t)point].push_back(r);
    }
    for (int first = 0; first < count; first += POINTS_AT_A_TIME) {
        some.setZero();
        for (int p = first; p < std::min(count, first + POINTS_AT_A_TIME); p++)
            add_point(jacobian, rows[(size_t)p], some.middleCols(3 * (p - first), 3));
        information[OBSERVATIONS].selfadjointView<Eigen::Lower>().rankUpdate(some, -1);
    }
    return information;
}

// False for the third row of an observation without depth.
bool is_informative(const ba_problem &in, int row)
{
    const int third = row - 8 * in.corner_count - in.plane_depth_count;
    return third < 0 || third >= 3 * in.observation_count || third % 3 != 2 || in.observations[third / 3].z > 0;
}

// Variance components (Foerstner 1979): for each kind of residuals the ratio of their squared sum to their redundancy,
// that is, the factor by which their variance exceeds the assumed one. 1 where the redundancy is below 20 (chosen by
// hand). errors: with robust weights, except that observations have none, because their outliers were removed before.
std::array<double, KINDS> variance_factors(const ba_problem &in, const std::vector<double> &errors, int points,
                                           const std::array<Eigen::MatrixXd, KINDS> &information,
                                           const Eigen::MatrixXd &covariance)
{
    const double min_redundancy = 20;
    std::array<double, KINDS> squares{}, redundancy{}, factors;
    for (size_t r = 0; r < errors.size(); r++) {
        const kind k = kind_of_row(in, (int)r);
        squares[k] += errors[r] * errors[r];
        redundancy[k] += is_informative(in, (int)r);
    }
    redundancy[OBSERVATIONS] -= points;
    for (size_t k = 0; k < KINDS; k++) {
        Eigen::MatrixXd whole = information[k].selfadjointView<Eigen::Lower>();
        redundancy[k] -= covariance.cwiseProduct(whole).sum();
        factors[k] = k != PRIOR && redundancy[k] > min_redundancy ? squares[k] / redundancy[k] : 1;
    }
    return factors;
}

// The Jacobian from each square's own axes, and from the lens's numbers, to the parameters.
Eigen::MatrixXd motions(const ba_problem &in, const solver_state &c, const jacobian_columns &which, int squares)
{
    Eigen::MatrixXd moves = Eigen::MatrixXd::Zero(which.all - which.points, squares + (in.lens ? BA_LENS_NUMBERS : 0));
    for (int s = 0; 6 * s < squares; s++) {
        const Matrix3 rotation =
            rotation_of(pose_from(in.squares[s].world_from_square, c.squares[(size_t)s])).toRotationMatrix();
        for (int half = 0; half < 2 && which.square[(size_t)s] >= 0; half++)
            moves.block<3, 3>(which.square[(size_t)s] - which.points + 3 * half, 6 * s + 3 * half) = rotation;
    }
    if (in.lens)
        moves.block<BA_LENS_NUMBERS, BA_LENS_NUMBERS>(which.lens - which.points, squares).setIdentity();
    return moves;
}

// all: of the squares, then of the lens.
void write_covariances(const ba_problem &in, int squares, const Eigen::MatrixXd &all)
{
    if (squares)
        Eigen::Map<Eigen::MatrixXd>(in.square_covariance, squares, squares) = all.topLeftCorner(squares, squares);
    if (in.lens)
        Eigen::Map<Eigen::Matrix<double, BA_LENS_NUMBERS, BA_LENS_NUMBERS>>(in.lens->covariance) =
            all.bottomRightCorner<BA_LENS_NUMBERS, BA_LENS_NUMBERS>();
}

// Fills in.square_covariance and the lens's, as far as they are asked for, at the solution in `c`.
//
// The covariance of weighted least squares whose weights come from the assumed variances, while the residuals have the
// estimated ones.
void find_covariance(const ba_problem &in, solver_state &c, ceres::Problem &problem)
{
    const jacobian_columns which(in, c, problem);
    ceres::Problem::EvaluateOptions options;
    sparse_jacobian jacobian = {{}, which.points};
    std::vector<double> errors, whole;
    const int squares = in.square_covariance ? 6 * in.square_count : 0, n = squares + (in.lens ? BA_LENS_NUMBERS : 0),
              poses = which.all - which.points;
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
    write_covariances(in, squares, out);
    options.parameter_blocks = which.blocks;
    if (!poses || !problem.Evaluate(options, nullptr, &errors, nullptr, &jacobian.all))
        return;
    const std::array<Eigen::MatrixXd, KINDS> information = information_of_poses(in, jacobian);
    const Eigen::LLT<Eigen::MatrixXd> factor(information[CORNERS] + information[PLANE_DEPTHS] +
                                             information[OBSERVATIONS] + information[PRIOR]);
    if (factor.info() != Eigen::Success)
        return;
    const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(poses, poses));
    options.apply_loss_function = false;
    if (!problem.Evaluate(options, nullptr, &whole, nullptr, nullptr))
        return;
    for (int r = 0; r < (int)errors.size(); r++)
        if (kind_of_row(in, r) == OBSERVATIONS)
            errors[(size_t)r] = whole[(size_t)r];
    const std::array<double, KINDS> factors = variance_factors(in, errors, which.points, information, covariance);
    const Eigen::MatrixXd moves = motions(in, c, which, squares);
    const Eigen::MatrixXd covariance_of_moves = covariance * moves;
    for (size_t k = 0; k < KINDS; k++)
        out += factors[k] * (covariance_of_moves.transpose() *
                             (information[k].selfadjointView<Eigen::Lower>() * covariance_of_moves));
    write_covariances(in, squares, out);
}

// ---------------------------------------------------------------- adjustment

constexpr double ROBUST_SIGMAS = 3;  // scale of the Cauchy kernels, standard deviations; chosen by hand
constexpr double MIN_DEPTH_M = 1e-3; // a point nearer to the camera's plane makes a step invalid

// Writes a derivative in Ceres's layout (row-major). out NULL: not requested.
template <int Rows> void write_jacobian(const Eigen::Matrix<double, Rows, 3> &derivative, double *out)
{
    for (int i = 0; out && i < 3 * Rows; i++)
        out[i] = derivative(i / 3, i % 3);
}

// Reprojection error of a tag's corners. Blocks: the camera's rotation and translation, the square's.
class corner_error : public ceres::SizedCostFunction<8, 3, 3, 3, 3>
{
  public:
    corner_error(const ba_corners *c, const pose_block *of_camera, const pose_block *of_square, double side_m, double x,
                 double y)
        : seen(c), camera_start(of_camera), square_start(of_square), half(side_m / 2), fx(x), fy(y)
    {
    }

    bool Evaluate(double const *const *blocks, double *residual, double **jacobians) const override
    {
        using Rows = Eigen::Matrix<double, 8, 3>;
        const evaluated_pose camera(camera_start->start, blocks[0], blocks[1]),
            square(square_start->start, blocks[2], blocks[3]);
        Eigen::Matrix<double, 8, 1> e;
        Rows by_block[4];
        for (int k = 0; k < 4; k++) {
            const Vector3 own(k == 1 || k == 2 ? half : -half, k >= 2 ? half : -half, 0);
            const Vector3 world = square.rotation * own + square.shift, p = camera.rotation * world + camera.shift;
            if (!(p[2] > MIN_DEPTH_M))
                return false;
            e[2 * k] = fx * p[0] / p[2] - seen->observed[2 * k];
            e[2 * k + 1] = fy * p[1] / p[2] - seen->observed[2 * k + 1];
            if (!jacobians)
                continue;
            Eigen::Matrix<double, 2, 3> by_p;
            by_p << fx / p[2], 0, -fx * p[0] / (p[2] * p[2]), 0, fy / p[2], -fy * p[1] / (p[2] * p[2]);
            const Eigen::Matrix<double, 2, 3> by_world = by_p * camera.rotation;
            by_block[0].middleRows<2>(2 * k) = by_p * camera.rotated_by_gibbs(world);
            by_block[1].middleRows<2>(2 * k) = by_p;
            by_block[2].middleRows<2>(2 * k) = by_world * square.rotated_by_gibbs(own);
            by_block[3].middleRows<2>(2 * k) = by_world;
        }
        const Eigen::Map<const Eigen::Matrix<double, 8, 8, Eigen::RowMajor>> whiten(&seen->whiten[0][0]);
        Eigen::Map<Eigen::Matrix<double, 8, 1>> out(residual);
        out = whiten * e;
        for (int b = 0; jacobians && b < 4; b++)
            write_jacobian<8>(whiten * by_block[b], jacobians[b]);
        return true;
    }

  private:
    const ba_corners *seen;
    const pose_block *camera_start, *square_start;
    double half, fx, fy;
};

// Error of a depth sample on a tag. Blocks as above. The ray r meets the plane with normal n through c at z = n.c /
// n.r.
class plane_error : public ceres::SizedCostFunction<1, 3, 3, 3, 3>
{
  public:
    plane_error(const ba_plane_depth *d, const pose_block *of_camera, const pose_block *of_square)
        : seen(d), camera_start(of_camera), square_start(of_square)
    {
    }

    bool Evaluate(double const *const *blocks, double *residual, double **jacobians) const override
    {
        const evaluated_pose camera(camera_start->start, blocks[0], blocks[1]),
            square(square_start->start, blocks[2], blocks[3]);
        const Vector3 ray(seen->x, seen->y, 1), across = square.rotation.col(2), normal = camera.rotation * across;
        const Vector3 centre = camera.rotation * square.shift + camera.shift;
        double slant = normal.dot(ray);
        if (!(slant * slant > 1e-6))
            return false;
        double z = normal.dot(centre) / slant, scale = 1 / (slant * seen->sigma_m);
        residual[0] = (z - seen->z) / seen->sigma_m;
        if (!jacobians)
            return true;
        const Vector3 off = centre - z * ray;
        write_jacobian<1>(scale * normal.cross(camera.shift - z * ray).transpose() * camera.by_gibbs, jacobians[0]);
        write_jacobian<1>(scale * normal.transpose(), jacobians[1]);
        write_jacobian<1>(scale * across.cross(camera.rotation.transpose() * off).transpose() * square.by_gibbs,
                          jacobians[2]);
        write_jacobian<1>(scale * across.transpose(), jacobians[3]);
        return true;
    }

  private:
    const ba_plane_depth *seen;
    const pose_block *camera_start, *square_start;
};

// Reprojection and depth error of a point. Blocks: the camera's rotation and translation, the point.
class point_error : public ceres::SizedCostFunction<3, 3, 3, 3>
{
  public:
    // [of_x 0; of_both of_y] whitens an error on the plane z = 1.
    point_error(const ba_observation *s, const pose_block *of_camera, double fx, double fy)
        : seen(s), camera_start(of_camera)
    {
        double xx = s->covariance[0], xy = s->covariance[1], yy = s->covariance[2];
        of_x = fx / std::sqrt(xx);
        of_y = fy / std::sqrt(yy - xy * xy / xx);
        of_both = -of_y * xy / xx * fx / fy;
    }

    bool Evaluate(double const *const *blocks, double *residual, double **jacobians) const override
    {
        const evaluated_pose camera(camera_start->start, blocks[0], blocks[1]);
        const Vector3 rotated = camera.rotation * Read3(blocks[2]), p = rotated + camera.shift;
        if (!(p[2] > MIN_DEPTH_M))
            return false;
        double uz = seen->z > 0 ? 1 / seen->sigma_m : 0;
        double x = p[0] / p[2], y = p[1] / p[2];
        residual[0] = of_x * (x - seen->x);
        residual[1] = of_both * (x - seen->x) + of_y * (y - seen->y);
        residual[2] = (p[2] - seen->z) * uz;
        if (!jacobians)
            return true;
        Matrix3 by_p;
        by_p << of_x / p[2], 0, -of_x * x / p[2], of_both / p[2], of_y / p[2], -(of_both * x + of_y * y) / p[2], 0, 0,
            uz;
        write_jacobian<3>(by_p * (-cross(rotated) * camera.by_gibbs), jacobians[0]);
        write_jacobian<3>(by_p, jacobians[1]);
        write_jacobian<3>(by_p * camera.rotation, jacobians[2]);
        return true;
    }

  private:
    const ba_observation *seen;
    const pose_block *camera_start;
    double of_x, of_both, of_y;
};

// An error whose row Row is that of a measured depth, in units of its sigma, with one more block: the factor of
// measured depths.
template <class Error, int Row> class with_depth_scale : public ceres::CostFunction
{
  public:
    with_depth_scale(std::unique_ptr<Error> e, double z, double sigma_m)
        : error(std::move(e)), depth_over_sigma(z / sigma_m)
    {
        set_num_residuals(error->num_residuals());
        *mutable_parameter_block_sizes() = error->parameter_block_sizes();
        mutable_parameter_block_sizes()->push_back(1);
    }

    bool Evaluate(double const *const *blocks, double *residual, double **jacobians) const override
    {
        if (!error->Evaluate(blocks, residual, jacobians))
            return false;
        const size_t last = parameter_block_sizes().size() - 1;
        residual[Row] += depth_over_sigma * (1 - blocks[last][0]);
        for (int i = 0; jacobians && jacobians[last] && i < num_residuals(); i++)
            jacobians[last][i] = i == Row ? -depth_over_sigma : 0;
        return true;
    }

  private:
    std::unique_ptr<Error> error;
    double depth_over_sigma;
};

// The prior of that factor.
class depth_scale_error : public ceres::SizedCostFunction<1, 1>
{
  public:
    explicit depth_scale_error(double sigma) : scale(1 / sigma) {}

    bool Evaluate(double const *const *blocks, double *residual, double **jacobians) const override
    {
        residual[0] = scale * (blocks[0][0] - 1);
        if (jacobians && jacobians[0])
            jacobians[0][0] = scale;
        return true;
    }

  private:
    double scale;
};

// What a problem's residuals are made of. They are owned here, not by ceres::Problem, which leaks what it is given
// while it runs out of memory. Outlives the problem.
struct terms {
    ceres::CauchyLoss corner_loss{ROBUST_SIGMAS * std::sqrt(8.0)}; // of eight residuals
    ceres::CauchyLoss depth_loss{ROBUST_SIGMAS}, point_loss{ROBUST_SIGMAS};
    std::vector<std::unique_ptr<ceres::CostFunction>> errors;

    template <class Error, class... Arguments> Error *add(Arguments &&...arguments)
    {
        auto error = std::make_unique<Error>(std::forward<Arguments>(arguments)...);
        Error *const added = error.get();
        errors.push_back(std::move(error));
        return added;
    }
};

ceres::Problem::Options terms_are_owned_elsewhere()
{
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
}

// Without a depth scale, the additional block is left out: it would prevent Ceres's fixed-size code.
void add_depth_errors(const ba_problem &in, solver_state &c, ceres::Problem &problem, terms &t)
{
    for (int32_t i = 0; i < in.plane_depth_count; i++) {
        const ba_plane_depth &seen = in.plane_depths[i];
        pose_block &camera = c.cameras[(size_t)seen.camera], &square = c.squares[(size_t)seen.square];
        if (in.depth_scale)
            problem.AddResidualBlock(t.add<with_depth_scale<plane_error, 0>>(
                                         std::make_unique<plane_error>(&seen, &camera, &square), seen.z, seen.sigma_m),
                                     &t.depth_loss, camera.gibbs, camera.shift, square.gibbs, square.shift,
                                     &c.depth_scale);
        else
            problem.AddResidualBlock(t.add<plane_error>(&seen, &camera, &square), &t.depth_loss, camera.gibbs,
                                     camera.shift, square.gibbs, square.shift);
    }
    for (int32_t i = 0; i < in.observation_count; i++) {
        const ba_observation &seen = in.observations[i];
        pose_block &camera = c.cameras[(size_t)seen.camera];
        double *point = &c.points[(size_t)seen.point].x;
        if (in.depth_scale && seen.z > 0)
            problem.AddResidualBlock(
                t.add<with_depth_scale<point_error, 2>>(std::make_unique<point_error>(&seen, &camera, in.fx, in.fy),
                                                        seen.z, seen.sigma_m),
                &t.point_loss, camera.gibbs, camera.shift, point, &c.depth_scale);
        else
            problem.AddResidualBlock(t.add<point_error>(&seen, &camera, in.fx, in.fy), &t.point_loss, camera.gibbs,
                                     camera.shift, point);
    }
    if (in.depth_scale)
        problem.AddResidualBlock(t.add<depth_scale_error>(in.depth_scale_sigma), nullptr, &c.depth_scale);
}

// The same kinds of errors in the same order, with the lens as a block of each.
void add_errors_of_lens(const ba_problem &in, solver_state &c, ceres::Problem &problem, terms &t)
{
    for (int32_t i = 0; i < in.corner_count; i++) {
        const ba_corners &seen = in.corners[i];
        pose_block &camera = c.cameras[(size_t)seen.camera], &square = c.squares[(size_t)seen.square];
        const double half = in.squares[seen.square].side_m / 2;
        problem.AddResidualBlock(t.add<ceres::AutoDiffCostFunction<lens_corner_error, 8, 3, 3, 3, 3, 5>>(
                                     new lens_corner_error{&seen, &camera, &square, half, in.fx, in.fy}),
                                 &t.corner_loss, camera.gibbs, camera.shift, square.gibbs, square.shift, c.lens);
    }
    for (int32_t i = 0; i < in.plane_depth_count; i++) {
        const ba_plane_depth &seen = in.plane_depths[i];
        pose_block &camera = c.cameras[(size_t)seen.camera], &square = c.squares[(size_t)seen.square];
        problem.AddResidualBlock(t.add<ceres::AutoDiffCostFunction<lens_plane_error, 1, 3, 3, 3, 3, 5, 1>>(
                                     new lens_plane_error{&seen, &camera, &square}),
                                 &t.depth_loss, camera.gibbs, camera.shift, square.gibbs, square.shift, c.lens,
                                 &c.depth_scale);
    }
    for (int32_t i = 0; i < in.observation_count; i++) {
        const ba_observation &seen = in.observations[i];
        pose_block &camera = c.cameras[(size_t)seen.camera];
        problem.AddResidualBlock(t.add<ceres::AutoDiffCostFunction<lens_point_error, 3, 3, 3, 3, 5, 1>>(
                                     new lens_point_error(&seen, &camera, in.fx, in.fy)),
                                 &t.point_loss, camera.gibbs, camera.shift, &c.points[(size_t)seen.point].x, c.lens,
                                 &c.depth_scale);
    }
    problem.AddResidualBlock(t.add<ceres::AutoDiffCostFunction<lens_prior, 5, 5>>(new lens_prior), nullptr, c.lens);
    if (in.depth_scale)
        problem.AddResidualBlock(t.add<depth_scale_error>(in.depth_scale_sigma), nullptr, &c.depth_scale);
}

void add_errors(const ba_problem &in, solver_state &c, ceres::Problem &problem, terms &t)
{
    if (in.lens) {
        add_errors_of_lens(in, c, problem, t);
        return;
    }
    for (int32_t i = 0; i < in.corner_count; i++) {
        const ba_corners &seen = in.corners[i];
        pose_block &camera = c.cameras[(size_t)seen.camera], &square = c.squares[(size_t)seen.square];
        problem.AddResidualBlock(
            t.add<corner_error>(&seen, &camera, &square, in.squares[seen.square].side_m, in.fx, in.fy), &t.corner_loss,
            camera.gibbs, camera.shift, square.gibbs, square.shift);
    }
    add_depth_errors(in, c, problem, t);
}

// Sets held blocks constant, and orders points to be eliminated before poses (Schur complement). False: there is no
// point to eliminate.
bool order_blocks(const ba_problem &in, solver_state &c, ceres::Problem &problem, ceres::ParameterBlockOrdering &order)
{
    bool any = false;
    auto add_pose = [&](pose_block &m, bool held) {
        for (double *block : {m.gibbs, m.shift}) {
            if (!problem.HasParameterBlock(block))
                continue;
            order.AddElementToGroup(block, 1);
            if (held)
                problem.SetParameterBlockConstant(block);
        }
    };
    for (int32_t i = 0; i < in.camera_count; i++)
        add_pose(c.cameras[(size_t)i], in.hold_cameras || i == in.held_camera);
    for (int32_t i = 0; i < in.square_count; i++)
        add_pose(c.squares[(size_t)i], in.squares[i].held);
    if (problem.HasParameterBlock(&c.depth_scale))
        order.AddElementToGroup(&c.depth_scale, 1);
    if (in.lens)
        order.AddElementToGroup(c.lens, 1);
    if (in.lens && !in.depth_scale && problem.HasParameterBlock(&c.depth_scale))
        problem.SetParameterBlockConstant(&c.depth_scale);
    for (int32_t i = 0; i < in.point_count; i++) {
        double *block = &c.points[(size_t)i].x;
        if (!problem.HasParameterBlock(block))
            continue;
        order.AddElementToGroup(block, 0);
        if (i < in.held_points)
            problem.SetParameterBlockConstant(block);
        any = any || i >= in.held_points;
    }
    return any;
}

bool is_finite(const pose &p)
{
    const quat &q = p.rotation;
    return v3_finite(p.translation) && std::isfinite(q.x + q.y + q.z + q.w);
}

bool is_finite(const ba_problem &in)
{
    bool finite = std::isfinite(in.fx) && std::isfinite(in.fy);
    for (int32_t i = 0; i < in.camera_count; i++)
        finite = finite && is_finite(in.cameras[i].camera_from_world);
    for (int32_t i = 0; i < in.square_count; i++)
        finite = finite && is_finite(in.squares[i].world_from_square) && std::isfinite(in.squares[i].side_m);
    for (int32_t i = 0; i < in.point_count; i++)
        finite = finite && v3_finite(in.points[i]);
    for (int32_t i = 0; i < in.corner_count; i++)
        for (int k = 0; k < 8; k++)
            finite = finite && std::isfinite(in.corners[i].observed[k]);
    for (int32_t i = 0; i < in.plane_depth_count; i++)
        finite = finite && std::isfinite(in.plane_depths[i].z) && std::isfinite(in.plane_depths[i].sigma_m);
    for (int32_t i = 0; i < in.observation_count; i++) {
        const ba_observation &o = in.observations[i];
        finite = finite && std::isfinite(o.x) && std::isfinite(o.y) && std::isfinite(o.z) && std::isfinite(o.sigma_m);
    }
    return finite;
}

// What Ceres needs for the problem, bytes: with the dense matrix of the poses and its factor 1.7 to 2.6 times the peak
// that was measured on problems of the mapper's tests, 6 to 150 cameras and up to 8836 observations.
size_t reserve_bytes(const ba_problem &in)
{
    const size_t poses = (size_t)in.camera_count + (size_t)in.square_count;
    const size_t dense = in.point_count ? 2 * sizeof(double) * (6 * poses) * (6 * poses) : 0;
    return 100000 + dense + 1000 * poses + 600 * (size_t)in.point_count + 5000 * (size_t)in.corner_count +
           1500 * (size_t)in.plane_depth_count + 2000 * (size_t)in.observation_count;
}

// Ceres is built to end the program where operator new fails: parts of it may not throw. It goes on with the reserve
// until it can be told to stop.
class stop_without_memory : public ceres::IterationCallback
{
  public:
    explicit stop_without_memory(const memory_reserve *r) : reserve(r) {}

    ceres::CallbackReturnType operator()(const ceres::IterationSummary &) override
    {
        return reserve->is_used() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
    }

  private:
    const memory_reserve *reserve;
};

enum status solve(const ba_problem &in)
{
    const memory_reserve reserve(reserve_bytes(in));
    stop_without_memory stop(&reserve);
    solver_state c(in);
    terms t;
    ceres::Problem problem(terms_are_owned_elsewhere());
    auto order = std::make_shared<ceres::ParameterBlockOrdering>();
    ceres::Solver::Options options;
    ceres::Solver::Summary summary;
    add_errors(in, c, problem, t);
    if (order_blocks(in, c, problem, *order)) {
        options.linear_solver_type = ceres::DENSE_SCHUR;
        options.linear_solver_ordering = order;
    } else { // sparse: a camera observes few squares
        options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
        options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    }
    options.num_threads = 1;
    options.max_num_iterations = in.max_iterations;
    options.function_tolerance =
        1e-5; // relative; the cost is tens of thousands, so this is less than one residual's share
    options.logging_type = ceres::SILENT;
    options.callbacks.push_back(&stop);
    ceres::Solve(options, &problem, &summary);
    if (reserve.is_used())
        throw std::bad_alloc();
    if (!summary.IsSolutionUsable())
        return fail(ERR_SOLVER, "the joint adjustment of cameras and tags found no solution");
    if (in.cost)
        *in.cost = summary.final_cost;
    if ((in.square_covariance && in.square_count) || in.lens)
        find_covariance(in, c, problem);
    c.write_back(in);
    return OK;
}

} // namespace

enum status bundle_adjust(const struct ba_problem *problem)
{
    if (!is_finite(*problem)) // Ceres would print a page about it first
        return fail(ERR_SOLVER, "the joint adjustment was given a number that is not finite");
    try {
        return solve(*problem);
    } catch (const std::bad_alloc &) {
        return fail(ERR_MEMORY, "no memory to adjust %d cameras and %d points", (int)problem->camera_count,
                    (int)problem->point_count);
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "the joint adjustment failed (Ceres: %s)", e.what());
    }
}
