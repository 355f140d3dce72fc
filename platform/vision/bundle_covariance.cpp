// The covariance of the squares' poses and of the lens after bundle adjustment: the inverse of the poses' information
// with points marginalised (Schur complement), scaled by estimated variance components.
#include "platform/vision/bundle_parameters.hpp"

#include <algorithm>
#include <array>

using namespace bundle;

namespace
{

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

} // namespace

// The covariance of weighted least squares whose weights come from the assumed variances, while the residuals have the
// estimated ones.
void bundle::find_covariance(const ba_problem &in, solver_state &c, ceres::Problem &problem)
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
