#include "tests/bench/bench_tags_peers.h"

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>

namespace
{

enum status find(enum aruco_corners how, const uint8_t *gray, const struct lens *lens, int32_t id, double side_m,
                 struct pose *out)
{
    cv::setNumThreads(1);
    const cv::Mat image(lens->height, lens->width, CV_8UC1, const_cast<uint8_t *>(gray));
    static const cv::Ptr<cv::aruco::Dictionary> family =
        cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
    auto options = cv::aruco::DetectorParameters::create();
    options->cornerRefinementMethod = how == ARUCO_SUBPIX     ? cv::aruco::CORNER_REFINE_SUBPIX
                                      : how == ARUCO_APRILTAG ? cv::aruco::CORNER_REFINE_APRILTAG
                                                              : cv::aruco::CORNER_REFINE_NONE;
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(image, family, corners, ids, options);
    for (size_t i = 0; i < ids.size(); i++) {
        if (ids[i] != id)
            continue;
        // OpenCV 4 prints this family rotated by 180 degrees: its top left is our bottom right.
        float shift = how == ARUCO_APRILTAG ? 0.5f : 0; // that method counts from the corner of the first pixel
        std::vector<cv::Point2f> seen;
        for (int k = 0; k < 4; k++)
            seen.push_back(corners[i][(size_t)(k + 2) % 4] - cv::Point2f(shift, shift));
        float h = (float)side_m / 2;
        const std::vector<cv::Point3f> square = {{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}};
        const cv::Matx33d camera(lens->fx, 0, lens->cx, 0, lens->fy, lens->cy, 0, 0, 1);
        cv::Vec3d rotation_vector, shift_m;
        if (!cv::solvePnP(square, seen, camera, cv::noArray(), rotation_vector, shift_m, false,
                          cv::SOLVEPNP_IPPE_SQUARE))
            return NOTHING;
        double angle = cv::norm(rotation_vector), s = angle > 1e-12 ? std::sin(angle / 2) / angle : 0.5;
        out->rotation = {rotation_vector[0] * s, rotation_vector[1] * s, rotation_vector[2] * s, std::cos(angle / 2)};
        out->translation = {shift_m[0], shift_m[1], shift_m[2]};
        return OK;
    }
    return NOTHING;
}

} // namespace

enum status aruco_peer_find(enum aruco_corners corners, const uint8_t *gray, const struct lens *lens, int32_t id,
                            double side_m, struct pose *camera_from_tag)
{
    try {
        return find(corners, gray, lens, id, side_m, camera_from_tag);
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "OpenCV: %s", e.what());
    }
}
