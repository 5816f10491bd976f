#include "look.hpp"

#include "metering.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace ise::cli {
namespace {

class bandwidth final : public gauge {
public:
    void see(const dynamic_packet& packet) override {
        auto size = packet.encoded().size();
        ++packets_;
        bytes_ += size;
        smallest_ = std::min(smallest_, size);
        largest_ = std::max(largest_, size);
    }

    std::string heading() const override {
        return fmt::format("{:>12}  {:>11}  {:>9}  {:>9}  {:>9}  {:>8}\n", "BYTES/S", "PACKETS/S", "SMALLEST", "MEAN",
                           "LARGEST", "LOST");
    }

    std::string row(duration window, const dynamic_stream& stream) override {
        auto of = std::exchange(*this, bandwidth());
        double time = std::chrono::duration<double>(window).count();
        auto size = [&](std::size_t bytes) { return of.packets_ == 0 ? std::string("-") : show_bytes(bytes); };
        return fmt::format("{:>10}/s  {:>11.2f}  {:>9}  {:>9}  {:>9}  {:>8}\n",
                           show_bytes(static_cast<std::uint64_t>(static_cast<double>(of.bytes_) / time)),
                           static_cast<double>(of.packets_) / time, size(of.smallest_),
                           size(of.packets_ == 0 ? 0 : of.bytes_ / of.packets_), size(of.largest_),
                           show_losses(stream));
    }

    std::string json(duration window, const dynamic_stream& stream) override {
        auto of = std::exchange(*this, bandwidth());
        double time = std::chrono::duration<double>(window).count();
        auto size = [&](std::size_t bytes) {
            return of.packets_ == 0 ? nlohmann::ordered_json() : nlohmann::ordered_json(bytes);
        };
        nlohmann::ordered_json told;
        told["bytes_per_s"] = static_cast<double>(of.bytes_) / time;
        told["packets_per_s"] = static_cast<double>(of.packets_) / time;
        told["bytes"] = of.bytes_;
        told["packets"] = of.packets_;
        told["smallest"] = size(of.smallest_);
        told["largest"] = size(of.largest_);
        told["connected"] = stream.connected();
        told["lost_at_provider"] = stream.counts().lost_at_provider;
        told["lost_here"] = stream.counts().lost_here;
        told["restarts"] = stream.counts().restarts;
        return told.dump() + "\n";
    }

private:
    std::uint64_t packets_ = 0;
    std::size_t bytes_ = 0; // of packets alone, without what frames and addresses take
    std::size_t smallest_ = static_cast<std::size_t>(-1), largest_ = 0;
};

} // namespace

task<> bw(context& in, hz_options options) {
    auto by = std::make_shared<bandwidth>();
    co_await measure(in, std::move(options), by);
}

} // namespace ise::cli
