#include <components/iridium/directip.hpp>
#include <components/iridium/directip_exchange.hpp>
#include <components/iridium_proxy/mt_path.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

constexpr ise::duration exchange_time = std::chrono::seconds(20);

class directip_path final : public mt_path {
public:
    directip_path(ise::loop& on, ise::endpoint gateway) : loop_(on), gateway_(std::move(gateway)) {}

    ise::task<link_outcome> give(mt_message what) override {
        iridium::directip_mt message;
        message.client_id = what.id;
        message.imei = iridium::imei_bytes(what.imei);
        message.payload = std::move(what.raw);
        auto answer =
            co_await iridium::ask_directip(loop_, gateway_, iridium::encode_directip_mt(message), exchange_time);
        using kind = link_outcome::kind;
        if (!answer)
            co_return make_outcome(answer.error().code() == ise::errc::unreachable ? kind::later : kind::unknown,
                                   "the gateway was not reached: " + answer.error().message());
        auto parsed = iridium::parse_mt_confirmation(*answer);
        if (!parsed) co_return make_outcome(kind::unknown, parsed.error().message());
        if (parsed->client_id != what.id)
            co_return make_outcome(kind::unknown, "the gateway confirmed another message");
        if (parsed->status >= 1)
            co_return make_outcome(
                kind::accepted, fmt::format("queued at the gateway as {}, place {}", parsed->auto_id, parsed->status),
                std::to_string(parsed->auto_id));
        co_return make_outcome(
            iridium::mt_status_passes(parsed->status) ? kind::later : kind::refused,
            fmt::format("{} (DirectIP status {})", iridium::explain_mt_status(parsed->status), parsed->status));
    }

    std::string where() const override { return gateway_.text(); }

private:
    ise::loop& loop_;
    ise::endpoint gateway_;
};

} // namespace

std::unique_ptr<mt_path> make_directip_path(ise::loop& on, ise::endpoint gateway) {
    return std::make_unique<directip_path>(on, std::move(gateway));
}

} // namespace atirma
