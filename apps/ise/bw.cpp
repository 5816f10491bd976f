// ise bw: bytes and packets per second of a subscription.
#include "json.hpp"
#include "metering.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace ise::cli {
namespace {

struct bw_line {
    double bytes_per_s = 0, packets_per_s = 0;
    std::uint64_t bytes = 0, packets = 0; ///< bytes of packets alone, without what frames and addresses take
    std::optional<std::uint64_t> smallest, largest;
    bool connected = false;
    std::uint64_t lost_at_provider = 0, lost_here = 0, restarts = 0;
};

class bandwidth final : public gauge {
public:
    void see(const received<dynamic_packet>& packet, time_point) override {
        std::uint64_t size = packet->encoded().size();
        ++now_.packets;
        now_.bytes += size;
        now_.smallest = std::min(now_.smallest.value_or(size), size);
        now_.largest = std::max(now_.largest.value_or(size), size);
    }

    std::string heading() const override {
        return fmt::format("{:>12}  {:>11}  {:>9}  {:>9}  {:>9}  {:>8}\n", "BYTES/S", "PACKETS/S", "SMALLEST", "MEAN",
                           "LARGEST", "LOST");
    }

    std::string row(duration window, const dynamic_stream& stream) override {
        auto of = take(window, stream);
        auto size = [&](std::uint64_t bytes) { return of.packets == 0 ? std::string("-") : show_bytes(bytes); };
        return fmt::format("{:>10}/s  {:>11.2f}  {:>9}  {:>9}  {:>9}  {:>8}\n",
                           show_bytes(static_cast<std::uint64_t>(of.bytes_per_s)), of.packets_per_s,
                           size(of.smallest.value_or(0)), size(of.bytes / std::max<std::uint64_t>(of.packets, 1)),
                           size(of.largest.value_or(0)), show_losses(stream));
    }

    std::string json(duration window, const dynamic_stream& stream) override { return json_line(take(window, stream)); }

private:
    bw_line take(duration window, const dynamic_stream& stream) {
        auto made = std::exchange(now_, bw_line());
        double time = std::chrono::duration<double>(window).count();
        made.bytes_per_s = static_cast<double>(made.bytes) / time;
        made.packets_per_s = static_cast<double>(made.packets) / time;
        made.connected = stream.connected();
        made.lost_at_provider = stream.counts().lost_at_provider;
        made.lost_here = stream.counts().lost_here;
        made.restarts = stream.counts().restarts;
        return made;
    }

    bw_line now_;
};

void declare_bw(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<metering_options>();
    add_metering(app, *given);
    app.callback([&made, given] {
        complete_metering(*given, made);
        made.work = [given](context& in) { return measure(in, *given, std::make_shared<bandwidth>()); };
    });
}

} // namespace

extern const command bw_command{"bw", measure_group, "bytes and packets per second of a subscription",
                                "  ise bw atirma/boat position --window 5s\n", declare_bw};

} // namespace ise::cli
