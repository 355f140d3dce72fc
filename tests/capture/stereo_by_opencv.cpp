#include "tests/capture/stereo_by_opencv.h"

#include <opencv2/calib3d.hpp>
#include <vector>

namespace
{

using points3 = std::vector<cv::Point3f>;
using points2 = std::vector<cv::Point2f>;

// Of one camera, or, with both, of the circles that both see.
struct sightings {
    std::vector<points3> board;
    std::vector<points2> left, right;
};

sightings of_one(const stereo_set &set, int camera)
{
    sightings s;
    for (int v = 0; v < set.pairs; v++) {
        points3 board;
        points2 seen;
        for (int i = 0; i < set.views[v].count[camera]; i++) {
            const auto &place = set.place[v][camera][i];
            const pixel at = set.circles[v][camera][i].at;
            board.emplace_back(place.column * set.board.pitch_m, place.row * set.board.pitch_m, 0);
            seen.emplace_back(at.x, at.y);
        }
        if (board.size() < 16)
            continue;
        s.board.push_back(board);
        s.left.push_back(seen);
    }
    return s;
}

sightings of_both(const stereo_set &set)
{
    sightings s;
    for (int v = 0; v < set.pairs; v++) {
        points3 board;
        points2 left, right;
        for (int i = 0; i < set.views[v].count[0]; i++)
            for (int k = 0; k < set.views[v].count[1]; k++) {
                const auto &a = set.place[v][0][i], &b = set.place[v][1][k];
                if (a.column != b.column || a.row != b.row)
                    continue;
                board.emplace_back(a.column * set.board.pitch_m, a.row * set.board.pitch_m, 0);
                left.emplace_back(set.circles[v][0][i].at.x, set.circles[v][0][i].at.y);
                right.emplace_back(set.circles[v][1][k].at.x, set.circles[v][1][k].at.y);
            }
        if (board.size() < 16)
            continue;
        s.board.push_back(board);
        s.left.push_back(left);
        s.right.push_back(right);
    }
    return s;
}

lens lens_of(const stereo_set &set, const cv::Mat &k, const cv::Mat &d)
{
    lens l = {};
    l.width = set.width;
    l.height = set.height;
    l.fx = k.at<double>(0, 0);
    l.fy = k.at<double>(1, 1);
    l.cx = k.at<double>(0, 2);
    l.cy = k.at<double>(1, 2);
    l.k1 = d.at<double>(0);
    l.k2 = d.at<double>(1);
    l.p1 = d.at<double>(2);
    l.p2 = d.at<double>(3);
    return l;
}

} // namespace

enum status stereo_by_opencv(const struct stereo_set *set, struct opencv_rig *rig)
{
    try {
        const cv::Size size(set->width, set->height);
        cv::Mat k[2], d[2], r, t, e, f;
        for (int camera = 0; camera < 2; camera++) {
            const sightings s = of_one(*set, camera);
            std::vector<cv::Mat> rotations, translations;
            cv::calibrateCamera(s.board, s.left, size, k[camera], d[camera], rotations, translations,
                                cv::CALIB_FIX_K3 | cv::CALIB_USE_LU,
                                cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 1e-9));
        }
        const sightings s = of_both(*set);
        rig->rms_px = cv::stereoCalibrate(s.board, s.left, s.right, k[0], d[0], k[1], d[1], size, r, t, e, f,
                                          cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_FIX_K3 | cv::CALIB_USE_LU);
        for (int camera = 0; camera < 2; camera++)
            rig->lens[camera] = lens_of(*set, k[camera], d[camera]);
        for (int y = 0; y < 3; y++) {
            for (int x = 0; x < 3; x++)
                rig->right_from_left[y][x] = r.at<double>(y, x);
            rig->right_from_left[y][3] = t.at<double>(y);
        }
        return OK;
    } catch (const std::exception &) {
        return ERR_SOLVER;
    }
}
