#include "taps.hpp"

#include <components/boat/receipt.hpp>
#include <components/iridium/at.hpp>
#include <components/iridium/bundle.hpp>

#include <charconv>

namespace atirma::stress {
namespace {

/// Frames of one direction.
template <class Take>
void decode(xbee::frame_decoder& by, ise::bytes_view bytes, Take take) {
    by.push(bytes);
    for (;;) {
        auto got = by.next();
        if (!got) return;
        if (const auto* frame = std::get_if<xbee::frame>(&*got)) take(*frame);
    }
}

class boat_xbee final : public tap {
public:
    boat_xbee(ledger& into, stopwatch time) : into_(into), time_(std::move(time)) {}

    void wrote(ise::bytes_view bytes) override {
        decode(out_, bytes, [this](const xbee::frame& frame) {
            const auto* request = std::get_if<xbee::transmit_request>(&frame);
            if (!request) return;
            under_way_.erase(request->frame_id);
            auto which = telemetry_key(request->payload);
            if (!which) return;
            into_.sent(link_id::xbee, *which, time_());
            under_way_[request->frame_id] = *which;
        });
    }
    void read(ise::bytes_view bytes) override {
        decode(in_, bytes, [this](const xbee::frame& frame) {
            if (const auto* packet = std::get_if<xbee::received_packet>(&frame)) {
                auto receipt = parse_receipt(packet->payload);
                if (!receipt) return;
                for (const auto& [boot, sequence] : receipt->packets) into_.receipted(key_of(boot, sequence), time_());
                return;
            }
            const auto* status = std::get_if<xbee::transmit_status>(&frame);
            if (!status || status->outcome != xbee::delivery::success) return;
            auto found = under_way_.find(status->frame_id);
            if (found != under_way_.end()) into_.acknowledged(link_id::xbee, found->second, time_());
        });
    }

private:
    ledger& into_;
    stopwatch time_;
    xbee::frame_decoder out_{xbee::api_mode::escaped}, in_{xbee::api_mode::escaped};
    std::map<std::uint8_t, packet_key> under_way_;
};

class shore_xbee final : public tap {
public:
    shore_xbee(ledger& into, stopwatch time) : into_(into), time_(std::move(time)) {}

    void wrote(ise::bytes_view) override {}
    void read(ise::bytes_view bytes) override {
        decode(in_, bytes, [this](const xbee::frame& frame) {
            const auto* packet = std::get_if<xbee::received_packet>(&frame);
            if (!packet) return;
            if (auto which = telemetry_key(packet->payload)) into_.arrived(*which, time_());
        });
    }

private:
    ledger& into_;
    stopwatch time_;
    xbee::frame_decoder in_{xbee::api_mode::plain};
};

class gprs_line final : public tap {
public:
    gprs_line(ledger& into, stopwatch time, gprs_numbers& numbers)
        : into_(into), time_(std::move(time)), numbers_(numbers) {}

    void wrote(ise::bytes_view bytes) override {
        take(out_, bytes, [this](const gprs::line& line) {
            const auto* record = std::get_if<gprs::record>(&line);
            if (!record) return;
            auto which = telemetry_key(record->raw);
            if (!which) return;
            into_.sent(link_id::gprs, *which, time_());
            // What a boat that lost its power had under way comes under the numbers of its next life.
            std::erase_if(numbers_, [&](const auto& one) { return one.first.first != record->boot; });
            numbers_[{record->boot, record->number}] = *which;
        });
    }
    void read(ise::bytes_view bytes) override {
        take(in_, bytes, [this](const gprs::line& line) {
            const auto* receipt = std::get_if<gprs::receipt>(&line);
            if (!receipt) return;
            auto first = numbers_.lower_bound({receipt->boot, 0});
            auto end = numbers_.upper_bound({receipt->boot, receipt->number});
            for (auto one = first; one != end; ++one) into_.acknowledged(link_id::gprs, one->second, time_());
            numbers_.erase(first, end);
        });
    }

private:
    template <class Take>
    static void take(gprs::line_reader& by, ise::bytes_view bytes, Take each) {
        by.push(bytes);
        for (;;) {
            auto got = by.next();
            if (!got) return;
            if (*got) each(**got);
        }
    }

    ledger& into_;
    stopwatch time_;
    gprs_numbers& numbers_;
    gprs::line_reader out_, in_;
};

class iridium_line final : public tap {
public:
    iridium_line(ledger& into, stopwatch time) : into_(into), time_(std::move(time)) {}

    // Commands end with CR; after AT+SBDWB=n come n bytes and their sum.
    void wrote(ise::bytes_view bytes) override {
        for (auto byte : bytes) {
            if (binary_left_ > 0) {
                data_.push_back(byte);
                if (--binary_left_ == 0) loaded();
                continue;
            }
            auto letter = std::to_integer<char>(byte);
            if (letter != '\r') {
                if (command_.size() < max_line) command_ += letter;
                continue;
            }
            command(std::exchange(command_, {}));
        }
    }
    void read(ise::bytes_view bytes) override {
        for (auto byte : bytes) {
            auto letter = std::to_integer<char>(byte);
            if (letter != '\r' && letter != '\n') {
                if (answer_.size() < max_line) answer_ += letter;
                continue;
            }
            answer(std::exchange(answer_, {}));
        }
    }

private:
    static constexpr std::size_t max_line = 512;

    void command(const std::string& line) {
        constexpr std::string_view write = "AT+SBDWB=";
        if (line == "AT+SBDD0" || line == "AT+SBDD2") held_.clear();
        if (line.find("AT+SBDIX") != std::string::npos) began_ = time_();
        auto at = line.find(write);
        if (at == std::string::npos) return;
        std::size_t size = 0;
        std::from_chars(line.data() + at + write.size(), line.data() + line.size(), size);
        data_.clear();
        binary_left_ = size == 0 ? 0 : size + 2;
        asked_for_ = binary_left_;
    }
    void loaded() {
        data_.resize(data_.size() - 2);
        held_.clear();
        auto packets = iridium::unbundle(data_);
        if (!packets) return;
        for (const auto& raw : *packets)
            if (auto which = telemetry_key(raw)) {
                held_.push_back(*which);
                into_.sent(link_id::iridium, *which, time_());
            }
    }
    void answer(const std::string& line) {
        // Not taken: no bytes follow.
        if (line.find("ERROR") != std::string::npos && binary_left_ == asked_for_) binary_left_ = 0;
        auto at = line.find("+SBDIX:");
        if (at == std::string::npos) return;
        auto parsed = iridium::parse_sbdix(std::string_view(line).substr(at));
        if (!parsed) return;
        into_.session({began_, time_(), parsed->mo_arrived()});
        if (!parsed->mo_arrived()) return;
        for (auto which : held_) into_.acknowledged(link_id::iridium, which, time_());
    }

    ledger& into_;
    stopwatch time_;
    std::string command_, answer_;
    ise::bytes data_;
    std::size_t binary_left_ = 0, asked_for_ = 0;
    std::vector<packet_key> held_; // in the modem's buffer
    ise::duration began_{};        // the last session
};

} // namespace

std::unique_ptr<tap> tap_boat_xbee(ledger& into, stopwatch time) {
    return std::make_unique<boat_xbee>(into, std::move(time));
}
std::unique_ptr<tap> tap_shore_xbee(ledger& into, stopwatch time) {
    return std::make_unique<shore_xbee>(into, std::move(time));
}
std::unique_ptr<tap> tap_gprs(ledger& into, stopwatch time, gprs_numbers& numbers) {
    return std::make_unique<gprs_line>(into, std::move(time), numbers);
}
std::unique_ptr<tap> tap_iridium(ledger& into, stopwatch time) {
    return std::make_unique<iridium_line>(into, std::move(time));
}

} // namespace atirma::stress
