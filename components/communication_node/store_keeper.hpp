#pragma once
#include <components/boat/communication.hpp>
#include <components/communication_node/node_context.hpp>
#include <components/communication_node/sqlite_store.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

/// A node's store that was opened, and what the node continues with.
struct opened_store {
    explicit opened_store(std::unique_ptr<node_store> of) : store(std::move(of)) {}

    std::unique_ptr<node_store> store;
    node_store::memory known;
    std::string notice;             ///< why files were set aside
    std::vector<std::string> aside; ///< damaged files, the store is a new one in their place
};

/// Opens the store, or a new one in the place of a damaged file. Tries again as long as the disk fails, or another
/// process uses the file: a disk that is full or not mounted yet may be there later, and so may a database. Throws
/// ise::error for the store of a newer program, and for a file that others can replace. Cancellation: terminal.
ise::task<std::unique_ptr<opened_store>> open_store(const node_context& here);

/// The store of a running node: whether the disk accepts data, and the replacement of a damaged file by a new one.
class store_keeper {
public:
    struct actions {
        std::function<void()> changed;    ///< whether the disk accepts data, or whether the store is complete
        std::function<void()> begun_anew; ///< the store is empty: put there what is known in memory
        std::function<void(const std::string&)> restore; ///< what is intact in this file belongs into the new store
    };
    store_keeper(node_context& here, opened_store& opened, actions then);

    node_store* operator->() noexcept { return store_.get(); }
    const node_store* operator->() const noexcept { return store_.get(); }
    /// For replication and repair, which are of files.
    sqlite_store& file() noexcept { return *file_; }

    /// Passes on what a write returned, and notes how the disk fared.
    template <class T>
    ise::result<T> written(ise::result<T> answer) {
        if (answer) accepted();
        else if (answer.error().code() != ise::errc::protocol_error && answer.error().code() != ise::errc::overloaded)
            failed(answer.error()); // else the page is wrong, or it is full for now
        return answer;
    }
    /// Passes on what a read returned; if it found damage, the store is replaced.
    template <class T>
    ise::result<T> read(ise::result<T> answer) {
        if (!answer && answer.error().code() == ise::errc::malformed) replace(answer.error());
        return answer;
    }
    /// The same for calls that call back.
    template <class T>
    node_store::then<T> written(node_store::then<T> done) {
        return [this, done = std::move(done)](ise::result<T> answer) mutable { done(written(std::move(answer))); };
    }
    template <class T>
    node_store::then<T> read(node_store::then<T> done) {
        return [this, done = std::move(done)](ise::result<T> answer) mutable { done(read(std::move(answer))); };
    }
    void failed(const ise::failure& why);

    /// Once a second: begins a new file if that failed before, removes what is too old, and adds missing checksums.
    void tend();

    const std::string& trouble() const noexcept { return trouble_; } ///< why nothing can be kept; empty: it can
    bool well() const noexcept { return trouble_.empty(); }
    bool restoring() const noexcept { return restoring_ != 0; } ///< a damaged file is still read
    void restored(const std::string& outcome);                  ///< of one of them
    void note(const std::string& what);                         ///< for `communication_state::store_notice`
    void report(communication_state& into) const;

    bool caught_up = false; ///< the other node had nothing that is missing here
    bool refilling = false; ///< it replaces a damaged store, and is not complete yet

private:
    void accepted();
    void replace(const ise::failure& why);
    void begin_anew();
    void cannot_keep(const std::string& why);

    node_context& here_;
    actions then_;
    std::unique_ptr<node_store> store_;
    sqlite_store* file_; // null: a database
    std::string trouble_;
    std::string notice_; // what happened to the store in this life: set back, or damaged and set aside
    std::size_t restoring_;
    ise::time_point next_prune_{};
    bool pruning_ = false;
};

} // namespace atirma
