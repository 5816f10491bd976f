#include <components/communication_node/store_keeper.hpp>

#include <components/communication_node/postgres_store.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration open_again = 1s;

std::string notice_of(const ise::failure& damage, const std::string& aside) {
    return fmt::format("its store was damaged and set aside as {}: {}", aside, damage.message());
}

ise::task<std::unique_ptr<opened_store>> open_database(const node_context& here) {
    postgres_store_options options;
    options.url = here.options.store;
    options.boat = here.boat();
    options.node = here.self.path();
    options.silence = here.options.silence;
    std::string said;
    for (;;) {
        auto store = std::make_unique<postgres_store>(here.self.on(), options);
        auto known = co_await store->opened();
        if (known) {
            auto made = std::make_unique<opened_store>(std::move(store));
            made->known = std::move(*known);
            co_return made;
        }
        if (known.error().code() != ise::errc::io_failed) throw ise::error(known.error());
        if (known.error().message() != said)
            here.self.log().error("its store cannot be opened; it is tried again every second",
                                  {{"cause", known.error().message()}});
        said = known.error().message();
        co_await here.self.sleep(open_again);
    }
}

} // namespace

ise::task<std::unique_ptr<opened_store>> open_store(const node_context& here) {
    if (!here.options.store.empty()) co_return co_await open_database(here);
    const auto& log = here.self.log();
    std::vector<std::string> aside;
    std::string notice, said;
    auto lock = store_lock::take(here.options.file); // also while a damaged file is set aside
    for (;;) {
        ise::failure why(ise::errc::io_failed, "");
        std::unique_ptr<opened_store> made;
        auto opened = lock ? sqlite_store::open(here.options.file, here.self.env().random(), *lock)
                           : ise::result<sqlite_store>(lock.error());
        if (opened) {
            auto store = std::make_unique<sqlite_store>(std::move(*opened));
            auto known = store->remembered();
            made = std::make_unique<opened_store>(std::move(store));
            if (known) {
                made->known = std::move(*known);
                made->notice = notice;
                made->aside = aside;
                co_return made;
            }
            why = known.error();
        } else {
            why = opened.error();
        }
        if (why.code() == ise::errc::malformed) {
            made.reset(); // closes the file
            auto moved = set_aside(here.options.file, why, here.self.wall(), log);
            if (moved) {
                notice = notice_of(why, *moved);
                aside.push_back(*moved);
            } else {
                why = ise::failure(ise::errc::io_failed, fmt::format("{}; {}", why.message(), moved.error().message()));
            }
        } else if (why.code() != ise::errc::io_failed) {
            throw ise::error(why);
        }
        if (why.code() == ise::errc::io_failed && why.message() != said)
            log.error("its store cannot be opened; it is tried again every second", {{"cause", why.message()}});
        said = why.message();
        co_await here.self.sleep(open_again);
        if (!lock) lock = store_lock::take(here.options.file);
    }
}

store_keeper::store_keeper(node_context& here, opened_store& opened, actions then)
    : refilling(!opened.aside.empty()), here_(here), then_(std::move(then)), store_(std::move(opened.store)),
      file_(dynamic_cast<sqlite_store*>(store_.get())), notice_(opened.notice), restoring_(opened.aside.size()) {}

void store_keeper::accepted() {
    if (well()) return;
    here_.self.log().info("the store takes packets again");
    trouble_.clear();
    caught_up = !here_.has_peer(); // the other one may have gone on alone
}

void store_keeper::failed(const ise::failure& why) {
    if (why.code() == ise::errc::malformed) replace(why);
    else cannot_keep(why.message());
}

void store_keeper::cannot_keep(const std::string& why) {
    if (well()) here_.self.log().error("nothing can be kept", {{"cause", why}});
    trouble_ = why;
    then_.changed();
}

void store_keeper::replace(const ise::failure& why) {
    if (!file_) return cannot_keep(why.message());
    auto aside = file_->set_aside(why, here_.self.wall(), here_.self.log());
    if (!aside) {
        auto text = fmt::format("{}; {}", why.message(), aside.error().message());
        if (text != trouble_) here_.self.log().error("its store is damaged", {{"cause", text}});
        auto again = file_->begin_anew(here_.self.env().random());
        trouble_ = again ? text : again.error().message();
        then_.changed();
        return;
    }
    notice_ = notice_of(why, *aside);
    refilling = true;
    ++restoring_;
    begin_anew();
    then_.restore(*aside);
}

void store_keeper::begin_anew() {
    auto begun = file_->begin_anew(here_.self.env().random());
    if (!begun) return cannot_keep(begun.error().message());
    trouble_.clear();
    caught_up = !here_.has_peer();
    then_.begun_anew();
}

void store_keeper::tend() {
    if (file_ && !file_->is_open()) begin_anew();
    if (here_.now() < next_prune_ || !well() || pruning_) return;
    next_prune_ = here_.now() + 1h;
    pruning_ = true;
    node_store::then<std::int64_t> done = [this](ise::result<std::int64_t> removed) {
        pruning_ = false;
        if (removed && *removed > 0) next_prune_ = here_.now() + 10s;
    };
    store_->tend(here_.options.max_packets, here_.options.max_commands, written(std::move(done)));
}

void store_keeper::note(const std::string& what) { notice_ += (notice_.empty() ? "" : "; ") + what; }

void store_keeper::restored(const std::string& outcome) {
    note(outcome);
    --restoring_;
    then_.changed();
}

void store_keeper::report(communication_state& into) const {
    into.trouble = trouble_.empty() && refilling ? notice_ : trouble_;
    into.store_notice = notice_;
    into.store = store_->number();
    into.packets = store_->head();
}

} // namespace atirma
