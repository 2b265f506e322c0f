"""What the labs teach with: pictures, sliders, checks, failures and Monte-Carlo runs; no estimator in any of them.

``plotting``     figures in the course's style, ellipses, consistency strips
``explore``      sliders that live in a kernel and in a static page
``exercises``    checks that answer at once, with a hint for each misconception; ``on_page`` judges an answer that was
                 typed on a page of the book
``projects``     whole systems, scored: a design runs in a process of its own (``judging``), earns points
                 (``criteria``) and gets a ``score_card``
``failures``     classic mistakes, each beside the check that catches it
``experiments``  seeded Monte-Carlo runs
"""
