// How the client finds its modem, and finds it again.
#include <components/xbee/radio_client.hpp>

namespace atirma::xbee {
namespace {
using namespace std::chrono_literals;
// Neither this frame nor its answer has a byte that AP=2 escapes: modems of both modes understand it, and it both of
// them.
constexpr std::uint8_t question_id = 0x52;
constexpr unsigned questions = 3;
constexpr instant answer_time = 1s, guard_time = 1200ms, plus_time = 2500ms;
} // namespace

void radio_client::start(instant now) {
    pause_ = 0ns;
    hold_until_ = now;
    silent_requests_ = 0;
    told_silent_ = false;
    output_.clear();
    asked_ = 0;
    ask(now);
    on_time(now);
}

void radio_client::stop(instant, std::string_view reason) {
    phase_ = phase::stopped;
    phase_due_ = gap_due_ = never;
    output_.clear();
    decoder_.reset(mode_);
    fail_written(std::string(reason));
    for (auto& r : std::exchange(waiting_, {})) fail(r, false, std::string(reason));
}

void radio_client::ask(instant now) {
    phase_ = phase::asking;
    ++asked_;
    decoder_.reset(mode_);
    auto wire = encode(at_request{question_id, at("AP"), {}, false}, api_mode::plain);
    output_.insert(output_.end(), wire.begin(), wire.end());
    phase_due_ = now + answer_time;
}

void radio_client::become_ready(instant now, api_mode mode) {
    // What the decoder holds behind the answer was sent in the mode that the answer names; it is at most a part of a
    // frame.
    mode_ = mode;
    if (decoder_.mode() != mode) decoder_.reset(mode);
    phase_ = phase::ready;
    phase_due_ = never;
    told_silent_ = false;
    silent_requests_ = 0;
    tell(radio_ready{mode});
    pump(now);
}

void radio_client::find_again(instant now, std::string reason) {
    fail_written(reason);
    silent_requests_ = 0;
    asked_ = 0;
    ask(now);
}

void radio_client::on_phase_time(instant now) {
    phase_due_ = never;
    switch (phase_) {
        case phase::stopped:
        case phase::ready: return;
        case phase::asking:
            if (asked_ < questions) return ask(now);
            if (!told_silent_) {
                told_silent_ = true;
                tell(radio_silent{"no modem answers on this line: is it an XBee, at this baud rate?"});
            }
            if (!options_.wake_transparent) {
                asked_ = 0;
                return ask(now);
            }
            phase_ = phase::quiet; // +++ wants silence before and after it
            phase_due_ = now + guard_time;
            return;
        case phase::quiet:
            phase_ = phase::plus;
            command_reply_.clear();
            write_text("+++");
            phase_due_ = now + plus_time;
            return;
        case phase::plus:
        case phase::setting:
        case phase::leaving: asked_ = 0; return ask(now);
    }
}

void radio_client::write_text(std::string_view text) {
    auto raw = ise::as_bytes(text);
    output_.insert(output_.end(), raw.begin(), raw.end());
}

} // namespace atirma::xbee
