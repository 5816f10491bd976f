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

    ise::task<mt_outcome> give(mt_message what) override {
        iridium::directip_mt message;
        message.client_id = what.id;
        message.imei = iridium::imei_bytes(what.imei);
        message.payload = std::move(what.raw);
        auto answer =
            co_await iridium::ask_directip(loop_, gateway_, iridium::encode_directip_mt(message), exchange_time);
        mt_outcome made;
        if (!answer) {
            made.what =
                answer.error().code() == ise::errc::unreachable ? mt_outcome::kind::later : mt_outcome::kind::unknown;
            made.text = "the gateway was not reached: " + answer.error().message();
            co_return made;
        }
        auto told = iridium::parse_mt_confirmation(*answer);
        if (!told || told->client_id != what.id) {
            made.what = mt_outcome::kind::unknown;
            made.text = told ? "the gateway confirmed another message" : told.error().message();
            co_return made;
        }
        if (told->status >= 1) {
            made.what = mt_outcome::kind::accepted;
            made.reference = std::to_string(told->auto_id);
            made.text = fmt::format("queued at the gateway as {}, place {}", told->auto_id, told->status);
            co_return made;
        }
        made.what = iridium::mt_status_passes(told->status) ? mt_outcome::kind::later : mt_outcome::kind::refused;
        made.text = fmt::format("{} (DirectIP status {})", iridium::explain_mt_status(told->status), told->status);
        co_return made;
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
