// ise hz: rate, jitter and losses of a subscription's packets.
#include "json.hpp"
#include "metering.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace ise::cli {
namespace {

struct hz_line {
    double rate_hz = 0;
    std::uint64_t packets = 0;
    std::optional<duration> mean_s, jitter_s, shortest_s, longest_s;
    bool connected = false;
    std::uint64_t received = 0, lost_at_provider = 0, lost_here = 0, restarts = 0;
};

// When packets arrive: rate and evenness over one window after the other. An interval belongs to the window in which it
// ends.
class arrivals final : public gauge {
public:
    void see(const received<dynamic_packet>&, time_point at) override {
        ++packets_;
        auto before = std::exchange(last_, at);
        if (!before) return;
        auto interval = at - *before;
        ++intervals_;
        // Welford: one pass, no loss of digits.
        double seconds = std::chrono::duration<double>(interval).count();
        double off = seconds - mean_s_;
        mean_s_ += off / static_cast<double>(intervals_);
        squares_ += off * (seconds - mean_s_);
        shortest_ = std::min(shortest_, interval);
        longest_ = std::max(longest_, interval);
    }

    std::string heading() const override {
        return fmt::format("{:>10}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}  {:>8}\n", "RATE", "MEAN", "JITTER", "SHORTEST",
                           "LONGEST", "PACKETS", "LOST");
    }

    std::string row(duration window, const dynamic_stream& stream) override {
        auto of = take(window, stream);
        auto interval = [](const std::optional<duration>& length) { return length ? show_duration(*length) : "-"; };
        return fmt::format("{:>7.2f} Hz  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}  {:>8}\n", of.rate_hz, interval(of.mean_s),
                           interval(of.jitter_s), interval(of.shortest_s), interval(of.longest_s), of.packets,
                           show_losses(stream));
    }

    std::string json(duration window, const dynamic_stream& stream) override { return json_line(take(window, stream)); }

private:
    hz_line take(duration window, const dynamic_stream& stream) {
        hz_line made;
        made.packets = packets_;
        made.rate_hz = static_cast<double>(packets_) / std::chrono::duration<double>(window).count();
        if (intervals_ != 0) {
            auto length = [](double seconds) {
                return std::chrono::duration_cast<duration>(std::chrono::duration<double>(seconds));
            };
            made.mean_s = length(mean_s_);
            made.jitter_s = length(std::sqrt(squares_ / static_cast<double>(intervals_)));
            made.shortest_s = shortest_;
            made.longest_s = longest_;
        }
        made.connected = stream.connected();
        made.received = stream.counts().received;
        made.lost_at_provider = stream.counts().lost_at_provider;
        made.lost_here = stream.counts().lost_here;
        made.restarts = stream.counts().restarts;
        auto last = last_;
        *this = arrivals();
        last_ = last;
        return made;
    }

    std::optional<time_point> last_;
    std::uint64_t packets_ = 0;
    std::uint64_t intervals_ = 0;
    double mean_s_ = 0;
    double squares_ = 0; // sum of squared distances from the mean
    duration shortest_ = duration::max();
    duration longest_{};
};

void declare_hz(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<metering_options>();
    add_metering(app, *given);
    app.callback([&made, given] {
        complete_metering(*given, made);
        made.work = [given](context& in) { return measure(in, *given, std::make_shared<arrivals>()); };
    });
}

} // namespace

extern const command hz_command{"hz", measure_group, "rate, jitter and losses of a subscription's packets",
                                "  ise hz atirma/boat position\n", declare_hz};

} // namespace ise::cli
