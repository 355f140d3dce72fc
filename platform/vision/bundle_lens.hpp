// Errors of bundle_adjustment.h where the lens is estimated, too; for bundle_adjustment.cpp only. Differentiated
// automatically: a lens is fitted once a map, not in the loop that builds it.
#pragma once
#include "platform/vision/bundle_parameters.hpp"

namespace bundle
{

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

} // namespace bundle
