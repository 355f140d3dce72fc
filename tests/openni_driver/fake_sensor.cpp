// A simulated depth sensor: a driver for the real OpenNI2 that presents the
// images of a folder (TUM layout, see platform/sensors/folder.c) as a device with a depth
// and a colour stream, so that everything above the driver is what runs with a
// real sensor. OpenNI2 loads it as lib*.so.0 from the folder OpenNI2/Drivers
// beside its own library; see CMakeLists.txt here.
//
// Set in the environment before OpenNI2 starts:
//   REENACT_FAKE_SENSOR=DIR[:DIR…]        a device for each folder; unset: none
//   REENACT_FAKE_SENSOR_FPS=30            frames per second; 0: as fast as they can be read
//   REENACT_FAKE_SENSOR_AT_END=unplug     or stop (send no more), or loop (times continue to rise)
//   REENACT_FAKE_SENSOR_UNPLUG_AFTER=N    disconnects after N frames
//   REENACT_FAKE_SENSOR_DEPTH=1mm         or 100um: the only unit it offers
//   REENACT_FAKE_SENSOR_MIRROR=settable   or fixed: always mirrored
//
// Like real sensors it mirrors by default. Times are those of
// the folder's list in microseconds; frame numbers count from 1.
#define XN_NEW(type, ...)  new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete (pointer)
#include <Driver/OniDriverAPI.h>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic" // a C header: compound literals
#include "platform/sensors/source_internal.h"
#pragma GCC diagnostic pop

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace
{

std::string setting(const char *name, const char *otherwise)
{
    const char *value = std::getenv(name);
    return value ? value : otherwise;
}

// OpenNI2's properties are untyped memory.
template <typename T> OniStatus write_property(const T &value, void *data, int *size)
{
    if (*size < static_cast<int>(sizeof value))
        return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(data, &value, sizeof value);
    *size = sizeof value;
    return ONI_STATUS_OK;
}

template <typename T> OniStatus read_property(T &value, const void *data, int size)
{
    if (size != static_cast<int>(sizeof value))
        return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(&value, data, sizeof value);
    return ONI_STATUS_OK;
}

class Stream : public oni::driver::StreamBase
{
  public:
    Stream(const OniVideoMode &mode, OniSensorType sensor, const lens &camera, std::function<void()> changed)
        : mode_(mode), sensor_(sensor), lens_(camera), changed_(std::move(changed))
    {
    }

    OniStatus start() override
    {
        started_ = true;
        changed_();
        return ONI_STATUS_OK;
    }

    void stop() override
    {
        // Waits for an image being sent: OpenNI2 frees its side of the stream next.
        std::lock_guard<std::mutex> guard(sending_);
        started_ = false;
    }

    bool started() const { return started_; }
    OniSensorType sensor() const { return sensor_; }

    OniBool isPropertySupported(int id) override
    {
        return id == ONI_STREAM_PROPERTY_VIDEO_MODE || id == ONI_STREAM_PROPERTY_HORIZONTAL_FOV ||
               id == ONI_STREAM_PROPERTY_VERTICAL_FOV || id == ONI_STREAM_PROPERTY_MIRRORING ||
               id == ONI_STREAM_PROPERTY_STRIDE || id == ONI_STREAM_PROPERTY_CROPPING ||
               id == ONI_STREAM_PROPERTY_MAX_VALUE || id == ONI_STREAM_PROPERTY_MIN_VALUE;
    }

    OniStatus getProperty(int id, void *data, int *size) override
    {
        switch (id) {
        case ONI_STREAM_PROPERTY_VIDEO_MODE: return write_property(mode_, data, size);
        case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
            return write_property(static_cast<float>(2 * std::atan(0.5 * lens_.width / lens_.fx)), data, size);
        case ONI_STREAM_PROPERTY_VERTICAL_FOV:
            return write_property(static_cast<float>(2 * std::atan(0.5 * lens_.height / lens_.fy)), data, size);
        case ONI_STREAM_PROPERTY_MIRRORING: return write_property(OniBool(mirrored_ ? TRUE : FALSE), data, size);
        case ONI_STREAM_PROPERTY_STRIDE: return write_property(stride(), data, size);
        case ONI_STREAM_PROPERTY_CROPPING:
            return write_property(OniCropping{}, data, size); // OpenNI2's recorder needs it
        case ONI_STREAM_PROPERTY_MAX_VALUE: return write_property(65535, data, size);
        case ONI_STREAM_PROPERTY_MIN_VALUE: return write_property(0, data, size);
        default: return ONI_STATUS_NOT_SUPPORTED;
        }
    }

    OniStatus setProperty(int id, const void *data, int size) override
    {
        if (id == ONI_STREAM_PROPERTY_VIDEO_MODE) {
            OniVideoMode wanted;
            OniStatus status = read_property(wanted, data, size);
            if (status != ONI_STATUS_OK)
                return status;
            return std::memcmp(&wanted, &mode_, sizeof wanted) ? ONI_STATUS_NOT_SUPPORTED : ONI_STATUS_OK;
        }
        if (id == ONI_STREAM_PROPERTY_MIRRORING && setting("REENACT_FAKE_SENSOR_MIRROR", "settable") != "fixed") {
            OniBool wanted;
            OniStatus status = read_property(wanted, data, size);
            if (status == ONI_STATUS_OK)
                mirrored_ = wanted != FALSE;
            return status;
        }
        return ONI_STATUS_NOT_SUPPORTED;
    }

    // Passes one image to OpenNI2 with this stream's settings; does nothing while the stream is stopped.
    void send(const void *pixels, int64_t time_ns, int index)
    {
        std::lock_guard<std::mutex> guard(sending_);
        if (!started_ || !pixels)
            return;
        OniFrame *frame = getServices().acquireFrame();
        if (!frame)
            return;
        frame->frameIndex = index;
        frame->timestamp = static_cast<uint64_t>(time_ns / 1000);
        frame->videoMode = mode_;
        frame->sensorType = sensor_;
        frame->width = mode_.resolutionX;
        frame->height = mode_.resolutionY;
        frame->stride = stride();
        frame->dataSize = stride() * mode_.resolutionY;
        frame->croppingEnabled = FALSE;
        frame->cropOriginX = frame->cropOriginY = 0;
        if (sensor_ == ONI_SENSOR_DEPTH)
            copy(static_cast<const uint16_t *>(pixels), static_cast<uint16_t *>(frame->data), 1);
        else
            copy(static_cast<const uint8_t *>(pixels), static_cast<uint8_t *>(frame->data), 3);
        raiseNewFrame(frame);
        getServices().releaseFrame(frame);
    }

  private:
    int stride() const { return mode_.resolutionX * (sensor_ == ONI_SENSOR_DEPTH ? 2 : 3); }

    template <typename T> void copy(const T *in, T *out, int channels) const
    {
        int w = mode_.resolutionX, h = mode_.resolutionY;
        bool tenths = mode_.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM;
        for (int y = 0; y < h; y++, in += w * channels, out += w * channels)
            for (int x = 0; x < w; x++)
                for (int c = 0; c < channels; c++) {
                    int value = in[(mirrored_ ? w - 1 - x : x) * channels + c];
                    out[x * channels + c] = static_cast<T>(tenths ? std::min(value * 10, 65535) : value);
                }
    }

    OniVideoMode mode_;
    OniSensorType sensor_;
    lens lens_;
    std::function<void()> changed_;
    std::mutex sending_;
    std::atomic<bool> started_{false};
    std::atomic<bool> mirrored_{true};
};

class Device : public oni::driver::DeviceBase
{
  public:
    Device(std::string folder, std::function<void()> unplugged)
        : folder_(std::move(folder)), unplugged_(std::move(unplugged))
    {
    }

    ~Device() override
    {
        {
            std::lock_guard<std::mutex> guard(lock_);
            closing_ = true;
        }
        changed_.notify_all();
        if (thread_.joinable())
            thread_.join();
        if (self_)
            folder_kind.close(self_);
    }

    bool open()
    {
        if (folder_open(&self_, folder_.c_str(), SOURCE_SENSOR, &facts_) != OK)
            return false;
        int fps = std::atoi(setting("REENACT_FAKE_SENSOR_FPS", "30").c_str());
        if (fps < 1)
            fps = 30; // the rate that the video mode states
        const calibration &c = facts_.calibration;
        bool tenths = setting("REENACT_FAKE_SENSOR_DEPTH", "1mm") == "100um";
        modes_[0] = {tenths ? ONI_PIXEL_FORMAT_DEPTH_100_UM : ONI_PIXEL_FORMAT_DEPTH_1_MM, c.depth.width,
                     c.depth.height, fps};
        modes_[1] = {ONI_PIXEL_FORMAT_RGB888, c.color.width, c.color.height, fps};
        sensors_[0] = {ONI_SENSOR_DEPTH, 1, &modes_[0]};
        sensors_[1] = {ONI_SENSOR_COLOR, 1, &modes_[1]};
        thread_ = std::thread([this] { run(); });
        return true;
    }

    OniStatus getSensorInfoList(OniSensorInfo **sensors, int *count) override
    {
        *sensors = sensors_;
        *count = facts_.calibration.color.width ? 2 : 1;
        return ONI_STATUS_OK;
    }

    oni::driver::StreamBase *createStream(OniSensorType sensor) override
    {
        int which = sensor == ONI_SENSOR_DEPTH ? 0 : 1;
        const calibration &c = facts_.calibration;
        auto stream = std::make_shared<Stream>(modes_[which], sensor, which ? c.color : c.depth, [this] {
            std::lock_guard<std::mutex> guard(lock_);
            changed_.notify_all();
        });
        std::lock_guard<std::mutex> guard(lock_);
        streams_.push_back(stream);
        return stream.get();
    }

    void destroyStream(oni::driver::StreamBase *stream) override
    {
        std::lock_guard<std::mutex> guard(lock_);
        for (size_t i = 0; i < streams_.size(); i++)
            if (streams_[i].get() == stream) {
                streams_.erase(streams_.begin() + static_cast<std::ptrdiff_t>(i));
                break;
            }
    }

    OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override
    {
        return mode == ONI_IMAGE_REGISTRATION_OFF || facts_.calibration.registered;
    }

    OniBool isPropertySupported(int id) override { return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION; }

    OniStatus getProperty(int id, void *data, int *size) override
    {
        return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION ? write_property(registration_, data, size)
                                                            : ONI_STATUS_NOT_SUPPORTED;
    }

    OniStatus setProperty(int id, const void *data, int size) override
    {
        OniImageRegistrationMode wanted;
        if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION || read_property(wanted, data, size) != ONI_STATUS_OK ||
            !isImageRegistrationModeSupported(wanted))
            return ONI_STATUS_NOT_SUPPORTED;
        registration_ = wanted;
        return ONI_STATUS_OK;
    }

  private:
    bool all_started() const
    {
        for (const auto &stream : streams_)
            if (!stream->started())
                return false;
        return !streams_.empty();
    }

    bool any_started() const
    {
        for (const auto &stream : streams_)
            if (stream->started())
                return true;
        return false;
    }

    // Opens the folder again and reads its first frame.
    enum status restart(frame *out)
    {
        folder_kind.close(self_);
        enum status status = folder_open(&self_, folder_.c_str(), SOURCE_SENSOR, &facts_);
        return status == OK ? folder_kind.next(self_, out) : NOTHING;
    }

    void run()
    {
        using clock = std::chrono::steady_clock;
        int fps = std::atoi(setting("REENACT_FAKE_SENSOR_FPS", "30").c_str());
        int unplug_after = std::atoi(setting("REENACT_FAKE_SENSOR_UNPLUG_AFTER", "-1").c_str());
        std::string at_end = setting("REENACT_FAKE_SENSOR_AT_END", "unplug");
        std::unique_lock<std::mutex> guard(lock_);
        changed_.wait(guard, [this] { return closing_ || any_started(); });
        // Both streams begin with the first frame, even if they are started one after the other.
        changed_.wait_for(guard, std::chrono::milliseconds(500), [this] { return closing_ || all_started(); });
        // OpenNI2 accepts no image until start() has returned; no real sensor is that quick.
        if (changed_.wait_for(guard, std::chrono::milliseconds(100), [this] { return closing_; }))
            return;
        int64_t first_ns = 0, last_ns = 0, added_ns = 0;
        auto due = clock::now();
        for (int index = 1; !closing_; index++) {
            if (fps > 0) {
                due += std::chrono::nanoseconds(1000000000 / fps);
                if (changed_.wait_until(guard, due, [this] { return closing_; }))
                    return;
            }
            frame image = {};
            enum status status = index - 1 == unplug_after ? NOTHING : folder_kind.next(self_, &image);
            if (status == NOTHING && index - 1 != unplug_after && at_end == "loop") {
                added_ns = last_ns - first_ns + 33333000;
                status = restart(&image);
            }
            if (status != OK) {
                guard.unlock();
                if (at_end != "stop" || index - 1 == unplug_after)
                    unplugged_();
                return;
            }
            int64_t time_ns = image.time_ns + added_ns;
            if (index == 1)
                first_ns = time_ns;
            last_ns = time_ns;
            // Without the lock: OpenNI2 calls this driver while holding its own locks. A stream that is destroyed
            // meanwhile was stopped before, and `streams` keeps it alive.
            auto streams = streams_;
            guard.unlock();
            for (const auto &stream : streams)
                stream->send(stream->sensor() == ONI_SENSOR_DEPTH ? static_cast<const void *>(image.depth)
                                                                  : image.color,
                             time_ns, index);
            guard.lock();
        }
    }

    std::string folder_;
    std::function<void()> unplugged_;
    void *self_ = nullptr; // the folder
    source_facts facts_ = {};
    OniVideoMode modes_[2];
    OniSensorInfo sensors_[2];
    OniImageRegistrationMode registration_ = ONI_IMAGE_REGISTRATION_OFF;
    std::mutex lock_; // guards streams_ and closing_
    std::condition_variable changed_;
    std::vector<std::shared_ptr<Stream>> streams_;
    bool closing_ = false;
    std::thread thread_;
};

class Driver : public oni::driver::DriverBase
{
  public:
    explicit Driver(OniDriverServices *services) : DriverBase(services) {}

    OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                         oni::driver::DeviceDisconnectedCallback disconnected,
                         oni::driver::DeviceStateChangedCallback changed, void *cookie) override
    {
        DriverBase::initialize(connected, disconnected, changed, cookie);
        std::string list = setting("REENACT_FAKE_SENSOR", "");
        for (size_t begin = 0; begin < list.size();) {
            size_t end = std::min(list.find(':', begin), list.size());
            if (end > begin)
                folders_.push_back(list.substr(begin, end - begin));
            begin = end + 1;
        }
        for (size_t i = 0; i < folders_.size(); i++) {
            OniDeviceInfo info = about(i);
            deviceConnected(&info);
        }
        return ONI_STATUS_OK;
    }

    oni::driver::DeviceBase *deviceOpen(const char *uri, const char *) override
    {
        for (size_t i = 0; i < folders_.size(); i++)
            if (about(i).uri == std::string(uri)) {
                auto device = std::make_unique<Device>(folders_[i], [this, i] {
                    OniDeviceInfo info = about(i);
                    deviceDisconnected(&info);
                });
                return device->open() ? device.release() : nullptr;
            }
        return nullptr;
    }

    void deviceClose(oni::driver::DeviceBase *device) override { delete device; }

    void shutdown() override {}

    void *enableFrameSync(oni::driver::StreamBase **, int) override
    {
        return this;
    } // frames are sent in pairs in any case
    void disableFrameSync(void *) override {}

  private:
    static OniDeviceInfo about(size_t index)
    {
        OniDeviceInfo info = {};
        std::snprintf(info.uri, sizeof info.uri, "reenact-fake-sensor/%zu", index);
        std::snprintf(info.vendor, sizeof info.vendor, "Reenact");
        std::snprintf(info.name, sizeof info.name, "fake sensor");
        return info;
    }

    std::vector<std::string> folders_;
};

} // namespace

ONI_EXPORT_DRIVER(Driver)
