#pragma once
#include <ise/ise.hpp>

struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};
struct log_line {
    std::uint32_t mile = 0;
    std::string mode;
};

inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};
inline constexpr ise::subscription<log_line> logbook{"logbook"};

class boat : public ise::component {
    ise::task<> run() override {
        provide(helm, [this](set_mode rq) {
            if (rq.mode == "fly") return mode_set{false, "boats sail"};
            mode_ = rq.mode;
            return mode_set{true, ""};
        });
        publish_every(logbook, std::chrono::seconds(1), [this] {
            if (mode_ != "moored") ++mile_;
            log_line line{mile_, mode_};
            return line;
        });
        co_return;
    }
    std::uint32_t mile_ = 0;
    std::string mode_ = "moored";
};
